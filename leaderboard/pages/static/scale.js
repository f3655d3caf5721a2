"use strict";
// A scale bar: how long a round number of metres is on the screen.
//
// di.scale.show(bar, pixels_a_metre)

(function (di) {
  const METRES = [1, 2, 5, 10, 20, 50, 100, 200, 500];
  const LONGEST_PX = 120;

  function show(bar, pixels_a_metre) {
    if (!bar) return;
    const metres = METRES.findLast((one) => one * pixels_a_metre <= LONGEST_PX) ?? METRES[0];
    bar.style.width = `${metres * pixels_a_metre}px`;
    bar.textContent = `${metres} m`;
  }

  di.scale = { show };
})((globalThis.driveinsight ??= {}));
