"""The features that go with each action."""

from __future__ import annotations

from agents.learned.features import FeatureConfig, Features
from agents.learned.plan_features import PLAN_FEATURES, PlanFeatures


def feature_names(config: FeatureConfig) -> tuple[str, ...]:
    """Names of the features."""
    if config.action == "predictive":
        return PLAN_FEATURES
    return config.names


def features_for(rows: int, config: FeatureConfig) -> Features | PlanFeatures:
    """Features of so many rows."""
    return (PlanFeatures if config.action == "predictive" else Features)(rows, config)
