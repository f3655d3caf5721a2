"use strict";
// Lets the SVG map be zoomed (by a pinch, or the wheel with ctrl: without, the page scrolls on) and
// dragged; marks keep their size on the screen.
//
// di.overview.enhance(svg), di.overview.legend(svg, caption, words)

(function (di) {
  const MARKS = 1000; // marks are drawn as if the map were so many pixels wide

  function enhance(svg) {
    const whole = svg.viewBox.baseVal;
    const full = { x: whole.x, y: whole.y, width: whole.width, height: whole.height };
    let view = { ...full };
    const bar = svg.parentElement.querySelector(".scale");
    let dragged = 0;

    function show() {
      svg.setAttribute("viewBox", `${view.x} ${view.y} ${view.width} ${view.height}`);
      const pixels = Math.max(svg.clientWidth, 1);
      di.scale.show(bar, 100 * Math.min(pixels / view.width, Math.max(svg.clientHeight, 1) / view.height));
      svg.style.setProperty("--mark", Math.max(view.width, (view.height * pixels) / Math.max(svg.clientHeight, 1)) / Math.max(pixels, MARKS * 0.6));
    }

    function place(event) {
      const point = new DOMPoint(event.clientX, event.clientY);
      return point.matrixTransform(svg.getScreenCTM().inverse());
    }

    svg.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      const factor = Math.min(Math.exp(event.deltaY * 0.0015), full.width / view.width);
      if (view.width * factor < full.width / 60) return;
      const { x, y } = place(event);
      view = {
        x: x - (x - view.x) * factor,
        y: y - (y - view.y) * factor,
        width: view.width * factor,
        height: view.height * factor,
      };
      show();
    }, { passive: false });
    svg.addEventListener("pointerdown", (event) => {
      dragged = 0;
      const start = place(event);
      const move = (other) => {
        dragged += Math.abs(other.movementX) + Math.abs(other.movementY);
        const now = place(other);
        view.x -= now.x - start.x;
        view.y -= now.y - start.y;
        show();
      };
      const end = () => removeEventListener("pointermove", move);
      addEventListener("pointermove", move);
      addEventListener("pointerup", end, { once: true });
    });
    svg.addEventListener("click", (event) => {
      if (dragged > 5) event.preventDefault(); // the end of a drag is no click on a link
    }, true);
    svg.addEventListener("dblclick", () => {
      view = { ...full };
      show();
    });
    new ResizeObserver(show).observe(svg);
    show();
  }

  // The kinds that there are, each with its shape and how often it happened
  function legend(svg, caption, words) {
    const counts = new Map();
    for (const mark of svg.querySelectorAll("#marks .mark")) {
      const kind = mark.getAttribute("class").replace("mark kind-", "");
      counts.set(kind, (counts.get(kind) ?? 0) + 1);
    }
    const items = [...counts].map(([kind, count]) => {
      const item = document.createElement("span");
      item.className = "key";
      item.innerHTML = `<svg viewBox="-11 -11 22 22" class="mark-key kind-${kind}"><use href="#mark-${kind}"/></svg>`;
      item.append(`${words(kind)} × ${count}`);
      return item;
    });
    const hint = document.createElement("span");
    hint.className = "hint";
    hint.textContent = "A click on a mark opens its moment; ctrl and the wheel zoom, drag moves the map, a double click shows all of it.";
    caption.replaceChildren(...items, hint);
  }

  di.overview = { enhance, legend };
})((globalThis.driveinsight ??= {}));
