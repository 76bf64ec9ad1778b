"""Agents as ONNX: the whole controller as one stateful step, for machines without Python."""
