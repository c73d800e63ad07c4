// SPDX-License-Identifier: Apache-2.0
// Writes what ONNX Runtime computes of the last of 16 observations: the numbers that policy_trial_test compares with where
// ONNX Runtime is not installed.
//
// usage: node tests/policy_host/onnx/write_vectors.mjs FOLDER... >tests/policy_host/onnx_runtime_vectors.json
// FOLDER: what operator_models.py and published_policies.py wrote; published files, called like in policy_trial_test.cpp.
import { createRequire } from "node:module";
import { readdirSync } from "node:fs";
import { join } from "node:path";

const ort = createRequire(new URL("../../node/package.json", import.meta.url))("onnxruntime-node");
const observations = 16;
const endings = [["_in", "_out"], [".in", ".out"], ["h0", "hn"], ["c0", "cn"]];

// The sequence of lab/policy_trial/policy_trial.cpp.
function generator() {
  let state = 1;
  return (values) => {
    for (let i = 0; i < values.length; ++i) {
      state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
      values[i] = (state >>> 8) / 2 ** 23 - 1;
    }
  };
}

async function lastOutputs(file) {
  const session = await ort.InferenceSession.create(file, { intraOpNumThreads: 1, interOpNumThreads: 1 });
  const feeds = {};
  for (const { name, shape, type } of session.inputMetadata) {
    const size = shape.reduce((a, b) => a * b, 1);
    feeds[name] = new ort.Tensor(type, type === "int32" ? new Int32Array(size) : new Float32Array(size), shape);
  }
  const stateOutput = (name) => {
    for (const [from, to] of endings) {
      const output = name.slice(0, name.length - from.length) + to;
      if (name.endsWith(from) && session.outputNames.includes(output)) return output;
    }
    return null;
  };
  const fill = generator();
  let result;
  for (let i = 0; i < observations; ++i) {
    for (const name of session.inputNames) {
      if (name === "time_step") feeds[name].data[0] = i;
      else if (stateOutput(name) === null) fill(feeds[name].data);
    }
    result = await session.run(feeds);
    for (const name of session.inputNames) {
      const output = stateOutput(name);
      if (output !== null) feeds[name].data.set(result[output].data);
    }
  }
  return session.outputNames.flatMap((name) => [...result[name].data].map((x) => Number(x.toPrecision(9))));
}

const vectors = {};
for (const folder of process.argv.slice(2)) {
  for (const file of readdirSync(folder)) {
    if (file.endsWith(".onnx") && !file.endsWith("without_state.onnx")) {
      vectors[file.slice(0, -".onnx".length)] = await lastOutputs(join(folder, file));
    }
  }
}
const names = Object.keys(vectors).sort();
console.log("{\n" + names.map((name) => `${JSON.stringify(name)}: ${JSON.stringify(vectors[name])}`).join(",\n") + "\n}");
