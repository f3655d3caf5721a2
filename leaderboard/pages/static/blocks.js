"use strict";
// Reads blocks: columns of numbers that leaderboard/records/blocks.py packed.
//
// di.blocks.read(text) -> Promise of {meta, columns: {name: Float64Array}}

(function (di) {
  const PLANES = 4;

  async function read(text) {
    if (typeof DecompressionStream === "undefined") {
      throw new Error("this browser cannot unpack the replay: it takes one of 2023 or later");
    }
    const packed = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const data = new Uint8Array(await new Response(stream).arrayBuffer());
    const end = data.indexOf(10);
    const head = JSON.parse(new TextDecoder().decode(data.subarray(0, end)));
    const columns = {};
    let at = end + 1;
    for (const { name, count, step, differences = 2 } of head.columns) {
      columns[name] = numbers(data.subarray(at, at + PLANES * count), count, step, differences);
      at += PLANES * count;
    }
    if (at !== data.length) throw new Error("the replay's data is damaged");
    return { meta: head.meta, columns };
  }

  // Four planes of bytes -> folded differences (of differences) -> numbers
  function numbers(bytes, count, step, differences) {
    const values = new Float64Array(count);
    for (let i = 0; i < count; i++) {
      const folded =
        bytes[i] | (bytes[count + i] << 8) | (bytes[2 * count + i] << 16) | (bytes[3 * count + i] << 24);
      values[i] = (folded >>> 1) ^ -(folded & 1);
    }
    for (let round = 0; round < differences; round++) {
      for (let i = 1; i < count; i++) values[i] += values[i - 1];
    }
    return values.map((value) => value * step);
  }

  di.blocks = { read };
})((globalThis.driveinsight ??= {}));
