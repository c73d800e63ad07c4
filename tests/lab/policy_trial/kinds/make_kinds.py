#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Writes networks of the kinds in which policies are published, with random weights of a fixed seed: make_kinds.py FOLDER [small | all]

Published policies are few and large, and most cannot be had here; what an engine trips over is their form: operators, opsets, types, inputs,
where the state is, where the weights are. Each kind is named by the project or the exporter whose form it has; the classes in actors.py,
recurrent.py and chunks.py say where that form was read (see also the table below). Sizes are the published ones unless a class says otherwise.

`small` (for tests) leaves out what takes seconds. FOLDER/kinds.txt says of each file which engine `policy.engine: auto` has to take: "refused" for
the one that must not run. Exit status 77: PyTorch or onnx is not there.
"""
import contextlib
import io
import pathlib
import shutil
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
HOST = HERE.parents[2] / "policy_host"
sys.path[:0] = [str(HERE), str(HOST / "leapp"), str(HOST / "exploy")]
try:
    import torch

    import actors
    import chunks
    import export
    import recurrent
    import make_bundle
    import make_exploy
except ImportError as error:
    print(f"cannot make policies: {error}", file=sys.stderr)
    sys.exit(77)

OBS = {"obs": (1, 48)}
STATE = (1, 1, 256)
MJLAB = {"run_path": "", "joint_names": ",".join(f"joint_{i}" for i in range(12)), "joint_stiffness": ",".join(["40.179"] * 12),
         "joint_damping": ",".join(["2.558"] * 12), "default_joint_pos": ",".join(["0.100"] * 12), "command_names": "twist",
         "observation_names": "base_lin_vel,base_ang_vel,projected_gravity,joint_pos,joint_vel,actions,command", "action_scale": ",".join(["0.439"] * 12)}
TRACKED = ("actions", "joint_pos", "joint_vel", "body_pos_w", "body_quat_w", "body_lin_vel_w", "body_ang_vel_w")


class Writer:
    def __init__(self, folder, everything):
        self.folder, self.everything, self.engines = folder, everything, []

    def file(self, name, engine):
        self.engines.append((name, engine))
        return self.folder / name

    def onnx(self, name, engine, module, shapes, outputs=("actions",), opset=11, **options):
        file = self.file(f"{name}.onnx", engine)
        export.to_onnx(module, file, shapes, outputs, opset, **options)
        return file

    def torchscript(self, name, module):
        export.to_torchscript(module, self.file(f"{name}.pt", "torchscript"))


def write_actors(write):
    new = lambda name, network, *arguments: export.seeded(name, network, *arguments)
    plain = new("rsl_rl_mlp", actors.RslRl)
    write.onnx("rsl_rl_mlp", "builtin", plain, OBS)
    write.torchscript("rsl_rl_mlp", plain)
    write.onnx("rsl_rl_normalised", "builtin", new("rsl_rl_normalised", actors.Normalised), OBS)
    write.onnx("rl_games", "builtin", new("rl_games", actors.RlGames), {"obs": (1, 60)}, ("mu", "log_std", "value"), dynamic_batch=True)
    write.onnx("skrl", "builtin", new("skrl", actors.Skrl), {"states": (1, 36)}, opset=13)
    write.onnx("stable_baselines3", "builtin", new("stable_baselines3", actors.StableBaselines), {"input": (1, 27)}, ("actions", "values", "log_prob"), 17)
    write.onnx("mujoco_playground", "builtin", new("mujoco_playground", actors.Playground), {"obs": (1, 103)}, ("continuous_actions",))
    him = new("himloco", actors.HimLoco)
    write.onnx("himloco", "builtin", him, {"obs_history": (1, 270)})
    write.torchscript("himloco", him)
    wtw = new("walk_these_ways", actors.WalkTheseWays)
    write.onnx("walk_these_ways", "builtin", wtw, {"obs_history": (1, 2100)})
    for part in ("adaptation_module", "actor_body"):
        write.torchscript(f"walk_these_ways_{part}", getattr(wtw, part))
    write.onnx("rma_history", "builtin", new("rma_history", actors.Rma), {"obs": (1, 53 * 11)})
    write.onnx("extreme_parkour_base", "builtin", new("extreme_parkour_base", actors.ParkourBase), {"obs": (1, 753), "depth_latent": (1, 32)})
    write.onnx("height_scan", "builtin", new("height_scan", actors.HeightScan), {"obs": (1, 235)})
    write.onnx("height_scan_cnn", "builtin", new("height_scan_cnn", actors.HeightScanCnn), {"policy": (1, 48), "height_scan": (1, 1, 11, 17)}, opset=17)
    mjlab = write.onnx("mjlab", "builtin", new("mjlab", actors.Normalised), OBS, opset=18)
    export.with_metadata(mjlab, MJLAB)
    write.onnx("whole_body_tracking", "builtin", new("whole_body_tracking", actors.MotionTracker), {"obs": (1, 160), "time_step": (1, 1)}, TRACKED)
    write.onnx("dreamwaq", "builtin", new("dreamwaq", actors.DreamWaq), {"obs": (1, 45), "obs_history": (1, 225)})
    write.onnx("amp_rsl_rl_mixture", "builtin", new("mixture", actors.Mixture), OBS, opset=17)
    write.onnx("mixture_einsum", "builtin", new("mixture", actors.Mixture, True), OBS, opset=17)
    write.onnx("tdmpc2", "builtin", new("tdmpc2", actors.TdMpc), {"obs": (1, 39)}, opset=17)
    write.onnx("points", "onnxruntime", new("points", actors.Points), {"point_cloud": (1, 64, 3), "agent_pos": (1, 9)}, opset=17)


def write_forms(write):
    """The same kind of actor as other exporters and tools write it."""
    beside = write.onnx("torch29_weights_beside", "builtin", export.seeded("torch29", actors.RslRl), OBS, opset=18)
    export.weights_beside(beside)
    write.onnx("opset20", "builtin", export.seeded("opset20", actors.Geglu), {"obs": (1, 64)}, opset=20)
    write.onnx("opset21", "builtin", export.seeded("opset21", actors.Geglu, torch.nn.Softplus), {"obs": (1, 64)}, opset=21)
    export.in_float16(write.onnx("float16", "onnxruntime", export.seeded("float16", actors.RslRl), OBS, opset=17))
    export.quantised(write.onnx("quantised_qdq", "onnxruntime", export.seeded("quantised", actors.RslRl), OBS, opset=17))
    with tempfile.TemporaryDirectory() as scratch, contextlib.redirect_stdout(io.StringIO()):
        for name, kind in (("agile_velocity", None), ("agile_velocity_history", "history")):
            (write.folder / name).mkdir()
            make_bundle.main(write.folder / name, kind)
            write.engines.append((f"{name}/walk.yaml", "builtin"))
        make_exploy.main(scratch)
        for name in ("step", "whole"):
            shutil.copy(f"{scratch}/{name}.onnx", write.file(f"exploy_{name}.onnx", "builtin"))


def write_recurrent(write):
    outputs, states = ("actions", "h_out", "c_out"), {"h_in": STATE, "c_in": STATE}
    lstm = export.seeded("rsl_rl_lstm", recurrent.StateOutside, 48, 256, (256, 128), 12)
    write.onnx("rsl_rl_lstm", "builtin", lstm, {**OBS, **states}, outputs)
    write.torchscript("rsl_rl_lstm", recurrent.StateInsideReset(lstm))
    write.onnx("rsl_rl_lstm_without_state", "refused", recurrent.WithoutState(lstm), OBS)
    small = export.seeded("unitree_rl_gym_lstm", recurrent.StateOutside, 47, 64, (32,), 12)
    write.onnx("unitree_rl_gym_lstm", "builtin", small, {"obs": (1, 47), "h_in": (1, 1, 64), "c_in": (1, 1, 64)}, outputs)
    write.torchscript("unitree_rl_gym_lstm", recurrent.StateInside(small))
    write.onnx("rsl_rl_gru", "builtin", export.seeded("rsl_rl_gru", recurrent.Gru), {**OBS, "h_in": (1, 1, 128)}, ("actions", "h_out"))
    write.onnx("layer_norm_lstm", "builtin", export.seeded("layer_norm_lstm", recurrent.LayerNormLstm), {**OBS, "h_in": (1, 128), "c_in": (1, 128)}, outputs, 17)
    write.onnx("dreamer_cell", "builtin", export.seeded("dreamer_cell", recurrent.DreamerCell), {"obs": (1, 40), "deter_in": (1, 256)}, ("actions", "deter_out"), 17)
    if write.everything:
        write.onnx("extreme_parkour_depth", "onnxruntime", export.seeded("extreme_parkour_depth", recurrent.DepthParkour),
                   {"obs": (1, 53), "depth": (1, 58, 87), "h_in": (1, 1, 512)}, ("actions", "h_out"), 17)


def write_chunks(write):
    new = lambda name, network, *arguments: export.seeded(name, network, *arguments)
    write.onnx("chunk_transformer", "onnxruntime", new("chunk_transformer", chunks.ChunkTransformer), OBS, opset=17)
    write.onnx("flow_velocity", "onnxruntime", new("flow_velocity", chunks.FlowVelocity), {"obs": (1, 30), "x_t": (1, 8, 6), "t": (1,)}, ("velocity",), 17)
    write.onnx("spatial_softmax", "onnxruntime", new("spatial_softmax", chunks.SpatialSoftmax), {"state": (1, 7), "image": (1, 3, 96, 96)}, opset=17)
    write.onnx("sb3_multi_input", "onnxruntime", new("sb3_multi_input", chunks.NatureCnn), {"image": (1, 1, 64, 64), "joints": (1, 9), "goal": (1, 3)}, opset=17)
    if not write.everything:
        return
    write.onnx("causal_gpt", "onnxruntime", new("causal_gpt", chunks.CausalGpt), {"obs": (1, 10, 27)}, opset=17)
    write.onnx("diffusion_unet", "onnxruntime", new("diffusion_unet", chunks.DiffusionUnet), {"sample": (1, 16, 7), "timestep": (1,), "global_cond": (1, 40)},
               ("noise",), 17)
    write.onnx("gr00t_action_head", "onnxruntime", new("gr00t_action_head", chunks.DiffusionTransformer),
               {"features": (1, 40, 256), "noisy_actions": (1, 16, 24), "timestep": (1,)}, ("velocity",), 16)
    write.onnx("smolvla_action_expert", "onnxruntime", new("smolvla_action_expert", chunks.ActionExpert),
               {"prefix": (1, 113, 480), "x_t": (1, 50, 32), "timestep": (1,)}, ("velocity",), 17)
    write.onnx("act", "onnxruntime", new("act", chunks.Act), {"state": (1, 14), "image": (1, 3, 224, 224)}, opset=17)


def main(folder, which="all"):
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    write = Writer(folder, which == "all")
    for part in (write_actors, write_forms, write_recurrent, write_chunks):
        part(write)
    (folder / "kinds.txt").write_text("".join(f"{name} {engine}\n" for name, engine in write.engines))


if __name__ == "__main__":
    main(*sys.argv[1:])
