"""Tianshou: its vector environments, in this process and in workers, and PPO."""

import gymnasium
import numpy as np
import torch
from tianshou.algorithm.algorithm_base import Algorithm
from tianshou.algorithm.modelfree.ppo import PPO
from tianshou.algorithm.modelfree.reinforce import ProbabilisticActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Batch, Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv, SubprocVectorEnv
from tianshou.trainer import OnPolicyTrainerParams
from tianshou.utils.net.common import Net
from tianshou.utils.net.continuous import ContinuousActorProbabilistic, ContinuousCritic
from torch.distributions import Independent, Normal

from agents import AgentInterface


def make() -> gymnasium.Env:
    """The environment as the agents see it."""
    return AgentInterface(gymnasium.make("aframe_env:AFrameHeave-v0"))


def algorithm(env: gymnasium.Env) -> Algorithm:
    """PPO for its spaces."""
    shape = env.observation_space.shape
    actor = ContinuousActorProbabilistic(
        preprocess_net=Net(state_shape=shape, hidden_sizes=(64, 64)),
        action_shape=env.action_space.shape,
        unbounded=True,
    )
    policy = ProbabilisticActorPolicy(
        actor=actor,
        dist_fn=lambda mean_and_std: Independent(Normal(*mean_and_std), 1),
        deterministic_eval=True,
        action_space=env.action_space,
    )
    critic = ContinuousCritic(preprocess_net=Net(state_shape=shape, hidden_sizes=(64, 64)))
    return PPO(policy=policy, critic=critic, optim=AdamOptimizerFactory(lr=3e-4))


def main() -> None:
    """Make, step, train, save and load."""
    torch.manual_seed(0)
    env = make()
    rows = DummyVectorEnv([make] * 2)
    workers = SubprocVectorEnv([make] * 2)
    print("made")

    for envs in (rows, workers):
        envs.seed([0, 1])
    features, infos = rows.reset()
    same, same_infos = workers.reset()
    for _ in range(20):
        np.testing.assert_array_equal(same, features)
        assert [info["omega1"] for info in same_infos] == [info["omega1"] for info in infos]
        actions = rows.action_space[0].sample()[None].repeat(2, axis=0)
        features, _, _, _, infos = rows.step(actions)
        same, _, _, _, same_infos = workers.step(actions)
    print("stepped")

    ppo = algorithm(env)
    ppo.run_training(
        OnPolicyTrainerParams(
            training_collector=Collector(ppo, workers, VectorReplayBuffer(2048, 2)),
            test_collector=None,
            max_epochs=2,
            epoch_num_steps=1024,
            collection_step_num_env_steps=512,
            update_step_num_repetitions=4,
            show_progress=False,
        )
    )
    workers.close()
    print("trained")

    torch.save(ppo.state_dict(), "ppo.pt")
    again = algorithm(env)
    again.load_state_dict(torch.load("ppo.pt", weights_only=True))
    batch = Batch(obs=np.asarray(features), info=Batch())
    with torch.no_grad():
        torch.testing.assert_close(again.policy(batch).act, ppo.policy(batch).act, rtol=0, atol=0)
    print("saved")


if __name__ == "__main__":
    main()
