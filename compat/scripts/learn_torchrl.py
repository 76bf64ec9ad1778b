"""TorchRL: GymEnv with the information in its tensors, a collector, and PPO."""

import gymnasium
import torch
from tensordict.nn import NormalParamExtractor, TensorDictModule
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import GymEnv, GymWrapper, ParallelEnv
from torchrl.envs.utils import ExplorationType, check_env_specs, set_exploration_type
from torchrl.modules import ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from agents import AgentInterface

STEPS, ROWS = 256, 2


def make() -> GymWrapper:
    """The environment as the agents see it."""
    return GymWrapper(AgentInterface(gymnasium.make("aframe_env:AFrameHeave-v0")))


def actor(inputs: int) -> ProbabilisticActor:
    """A policy over so many features."""
    network = nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 2), NormalParamExtractor())
    return ProbabilisticActor(
        TensorDictModule(network, in_keys=["observation"], out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=TanhNormal,
        return_log_prob=True,
        default_interaction_type=ExplorationType.RANDOM,
    )


def main() -> None:
    """Make, step, train, save and load."""
    torch.manual_seed(0)
    env = GymEnv("aframe_env:AFrameHeave-v0", observation="sensors").auto_register_info_dict()
    rows = ParallelEnv(ROWS, make)
    print("made")

    check_env_specs(env)
    env.set_seed(0)
    met = env.rollout(20)
    assert met["next", "load_position"].shape == (20, 3)
    assert (met["next", "omega1"].diff(dim=0) >= 0.0).all()
    torch.testing.assert_close(-met["next", "reward"].sum(), met["next", "omega1"][-1].sum().float())
    print("stepped")

    inputs = make().observation_spec["observation"].shape[-1]
    policy = actor(inputs)
    critic = ValueOperator(nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 1)))
    advantage = GAE(gamma=0.94, lmbda=0.97, value_network=critic)
    loss = ClipPPOLoss(policy, critic)
    optimizer = torch.optim.Adam(loss.parameters(), 3e-4)
    collector = Collector(rows, policy, frames_per_batch=STEPS, total_frames=4 * STEPS)
    for collected in collector:
        for _ in range(4):
            advantage(collected)
            losses = loss(collected.reshape(-1))
            optimizer.zero_grad()
            (losses["loss_objective"] + losses["loss_critic"] + losses["loss_entropy"]).backward()
            optimizer.step()
    collector.shutdown()
    print("trained")

    torch.save(policy.state_dict(), "policy.pt")
    again = actor(inputs)
    again.load_state_dict(torch.load("policy.pt", weights_only=True))
    with set_exploration_type(ExplorationType.DETERMINISTIC), torch.no_grad():
        expected, found = (each(collected.select("observation"))["action"] for each in (policy, again))
    torch.testing.assert_close(found, expected, rtol=0, atol=0)
    print("saved")


if __name__ == "__main__":
    main()
