"""The features that go with each action."""

from __future__ import annotations

from agents.learned.features import SENSED_FEATURES, STATE_FEATURES, FeatureConfig, Features
from agents.learned.plan_features import PLAN_FEATURES, PlanFeatures


def feature_names(config: FeatureConfig) -> tuple[str, ...]:
    """Names of the features."""
    if config.action == "predictive":
        return PLAN_FEATURES
    return STATE_FEATURES if config.sensors is None else SENSED_FEATURES


def features_for(rows: int, config: FeatureConfig) -> Features | PlanFeatures:
    """Features of so many rows."""
    return (PlanFeatures if config.action == "predictive" else Features)(rows, config)
