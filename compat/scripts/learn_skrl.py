"""skrl: PPO on the native vector environment below the agents' interface."""

import gymnasium
import torch
from gymnasium.vector import AutoresetMode
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import Wrapper, wrap_env
from skrl.memories.torch import RandomMemory
from skrl.trainers.torch import SequentialTrainer
from skrl.utils import set_seed
from skrl.utils.model_instantiators.torch import deterministic_model, gaussian_model

import aframe_env  # noqa: F401  (registers the environment)
from agents import AgentVectorInterface

ROLLOUTS = 128
NETWORK = [{"name": "net", "input": "OBSERVATIONS", "layers": [64, 64], "activations": "tanh"}]


def ppo(env: Wrapper) -> PPO:
    """An agent for its spaces."""
    spaces = {"observation_space": env.observation_space, "action_space": env.action_space, "device": env.device}
    models = {
        "policy": gaussian_model(**spaces, network=NETWORK, output="ACTIONS", initial_log_std=-1.65, clip_actions=True),
        "value": deterministic_model(**spaces, network=NETWORK, output="ONE"),
    }
    memory = RandomMemory(memory_size=ROLLOUTS, num_envs=env.num_envs, device=env.device)
    return PPO(models=models, memory=memory, cfg=PPO_CFG(rollouts=ROLLOUTS, discount_factor=0.94), **spaces)


def main() -> None:
    """Make, step, train, save and load."""
    set_seed(0)
    rows = gymnasium.make_vec("AFrameHeave-v0", num_envs=16, autoreset_mode=AutoresetMode.SAME_STEP)
    env = wrap_env(AgentVectorInterface(rows, stagger=True))
    single = wrap_env(gymnasium.make("AFrameHeave-v0"))
    print("made")

    for each in (env, single):
        observation, _ = each.reset()
        for _ in range(20):
            observation, reward, _, _, _ = each.step(torch.zeros(each.num_envs, 1))
            assert torch.isfinite(observation).all()
            assert torch.isfinite(reward).all()
    print("stepped")

    agent = ppo(env)
    SequentialTrainer(env=env, agents=agent, cfg={"timesteps": 256, "headless": True}).train()
    print("trained")

    agent.save("agent.pt")
    again = ppo(env)
    again.load("agent.pt")
    observation, _ = env.reset()
    with torch.no_grad():
        for name in ("policy", "value"):
            seen = {"observations": observation}
            expected, _ = agent.models[name].compute(seen, role=name)
            found, _ = again.models[name].compute(seen, role=name)
            torch.testing.assert_close(found, expected, rtol=0, atol=0)
    print("saved")


if __name__ == "__main__":
    main()
