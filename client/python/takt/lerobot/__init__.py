# SPDX-License-Identifier: Apache-2.0
"""Checkpoint folders of LeRobot as policies of robot files: python3 -m takt.lerobot export FOLDER --robot robot.yaml ... (docs/python-policy.md).

Only numpy is needed: config.json, the safetensors files and the processors' JSON are read, and ONNX is written. No pickle is loaded, and no code of the folder runs.
"""
