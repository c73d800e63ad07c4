// SPDX-License-Identifier: Apache-2.0
'use strict';
// Reads what packed_block.cpp wrote: base64, a zlib stream, columns of 16-bit differences in byte planes.
const takt = {};

takt.openBlock = (function () {
  const kMissing = -32768;
  const kSecondsPerTime = 1e-5;

  function bytesOf(base64) {
    if (Uint8Array.fromBase64) return Uint8Array.fromBase64(base64);
    const text = atob(base64);
    const bytes = new Uint8Array(text.length);
    for (let at = 0; at < text.length; ++at) bytes[at] = text.charCodeAt(at);
    return bytes;
  }

  async function inflated(bytes) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  function timesOf(bytes, rows) {
    const times = new Float64Array(rows);
    let time = 0;
    for (let row = 0; row < rows; ++row) {
      time += (bytes[row] | bytes[rows + row] << 8 | bytes[2 * rows + row] << 16 | bytes[3 * rows + row] << 24) >>> 0;
      times[row] = time * kSecondsPerTime;
    }
    return times;
  }

  function valuesOf(bytes, start, rows, offset, scale) {
    const values = new Float32Array(rows);
    let integer = 0;
    for (let row = 0; row < rows; ++row) {
      integer = (integer + (bytes[start + row] | bytes[start + rows + row] << 8)) << 16 >> 16;
      values[row] = integer === kMissing ? NaN : offset + scale * integer;
    }
    return values;
  }

  // layout, base64 -> {rows, bucketTicks, times: s since the run's first tick, has(name), column(name)}.
  // Columns are decoded when they are first asked for.
  return async function (layout, base64) {
    const bytes = await inflated(bytesOf(base64.trim()));
    const place = new Map(layout.columns.map(([name], index) => [name, index]));
    const decoded = new Map();
    return {
      rows: layout.rows,
      bucketTicks: layout.bucket_ticks,
      times: timesOf(bytes, layout.rows),
      has: (name) => place.has(name),
      column(name) {
        if (!decoded.has(name)) {
          const index = place.get(name);
          const [, offset, scale] = layout.columns[index];
          decoded.set(name, valuesOf(bytes, layout.rows * (4 + 2 * index), layout.rows, offset, scale));
        }
        return decoded.get(name);
      },
    };
  };
})();
