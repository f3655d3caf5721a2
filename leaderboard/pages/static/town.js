"use strict";
// The streets, taken from the page's SVG map, as paths that a canvas draws. Centimetres.
//
// di.town.of(svg_group) -> {levels: [ground, bridges]}, each {shapes, stops}
//   shapes: [{name, box, path}] in the order in which they are laid; stops: [{light, path, box}]

(function (di) {
  function of(group) {
    const levels = [0, 1].map(() => ({ shapes: [], stops: [] }));
    for (const element of group.querySelectorAll("path")) {
      const level = levels[Number(element.dataset.level)];
      const text = element.getAttribute("d");
      const path = new Path2D(text);
      if (element.classList.contains("stop")) {
        const light = element.dataset.light === undefined ? null : Number(element.dataset.light);
        level.stops.push({ light, path, box: start_of(text) });
      } else {
        const box = element.dataset.box.split(" ").map(Number);
        level.shapes.push({ name: element.getAttribute("class"), box, path });
      }
    }
    return { levels };
  }

  function start_of(text) {
    const [x, y] = text.slice(1, text.indexOf("l")).split(" ").map(Number);
    return [x - 500, y - 500, x + 500, y + 500];
  }

  di.town = { of };
})((globalThis.driveinsight ??= {}));
