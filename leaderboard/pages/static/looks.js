"use strict";
// What was seen inside the policy: moments, waypoints, gradients, attention, activation maps.
//
// const looks = di.looks.of(head, block)
// looks.place(time_s) -> which moment; looks.time_s(i), looks.waypoints(i), looks.gradient(i, g),
// looks.attention(i, layer, head, g), looks.has_responses
// di.looks.map(entry, block) -> {entry, image(i) -> canvas, peak(i), share(i)};
//   share: of its component's gradient in the largest one; di.looks.heat(share) -> [r, g, b]

(function (di) {
  // From dark violet by red to light yellow: readable on light and dark, and in grey
  const HEAT = [
    [0.0, [24, 8, 60]], [0.25, [112, 24, 110]], [0.5, [203, 56, 74]], [0.75, [249, 142, 40]], [1.0, [252, 250, 160]],
  ];

  const FAINTEST = 0.35; // how much is left of a map that is as good as nothing beside the components

  function heat(share) {
    const upper = Math.max(1, HEAT.findIndex(([from]) => from >= share));
    const [from, low] = HEAT[upper - 1];
    const [to, high] = HEAT[upper];
    const part = (share - from) / (to - from);
    return low.map((value, i) => Math.round(value + (high[i] - value) * part));
  }

  function of(head, { columns }) {
    const times = columns.tick.map((tick) => tick * head.tick_s);
    const count = times.length;
    return {
      count,
      times,
      has_responses: head.groups.length > 0,
      time_s: (i) => times[i],
      place(time_s) {
        let i = 0;
        while (i + 1 < count && times[i + 1] <= time_s + 1e-6) i++;
        return i;
      },
      waypoints(i) {
        return Array.from({ length: head.waypoints }, (_, point) => [
          columns.waypoints_x[point * count + i], columns.waypoints_y[point * count + i],
        ]);
      },
      gradient: (i, g) => [columns[`gradient_x_${g}`][i], columns[`gradient_y_${g}`][i]],
      attention: (i, layer, one, g) => columns[`attention_${g}`][(layer * head.heads + one) * count + i],
    };
  }

  // Maps of a moment as pictures; a map of the ground as x to the right and y down, as canvases are
  function map(entry, { columns }) {
    const { rows, columns: wide, extent_m } = entry;
    const ground = extent_m !== null;
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = ground ? [rows, wide] : [wide, rows];
    const context = canvas.getContext("2d");
    const fade = (i) => FAINTEST + (1 - FAINTEST) * Math.min(1, columns.share[i] / entry.quiet);
    let drawn = -1;
    return {
      entry,
      peak: (i) => columns.peak[i],
      share: (i) => columns.share[i],
      image(i) {
        if (i === drawn) return canvas;
        drawn = i;
        const of_drive = entry.peak > 0 ? columns.peak[i] / entry.peak : 0; // one scale for all moments
        const picture = context.createImageData(canvas.width, canvas.height);
        for (let row = 0; row < rows; row++) {
          for (let column = 0; column < wide; column++) {
            const share = of_drive * columns.cells[(i * rows + row) * wide + column];
            const at = 4 * (ground ? column * rows + row : row * wide + column);
            picture.data.set(heat(share), at);
            picture.data[at + 3] = 220 * fade(i) * Math.min(1, 1.5 * share ** 1.2);
          }
        }
        context.putImageData(picture, 0, 0);
        return canvas;
      },
    };
  }

  di.looks = { of, map, heat };
})((globalThis.driveinsight ??= {}));
