"use strict";
// A row for each component: gradients or attention over time, and both at the cursor.
//
// const rows = di.rows.on(element, {head, looks, end_s, events, marks, on_time})
// rows.tell(time_s), rows.mode(name), rows.own_scale(yes), rows.layer(number), rows.dropped(names),
// rows.paint()

(function (di) {
  const SIDE = 8; // the scrub bar's ends lie that much within it
  const HEIGHT = 34;
  const NEARLY = 0.99; // share of all values that are drawn whole

  function on(element, { head, looks, end_s, events, marks, on_time }) {
    const { groups } = head;
    let [mode, own, layer, now] = ["gradient", false, head.layers - 1, 0];
    const rows = groups.map((name) => row(name));
    const cursor = document.createElement("div");
    cursor.className = "cursor";
    element.replaceChildren(...rows.map((one) => one.element), cursor);
    for (const { strip } of rows) {
      const seek = (event) => on_time(((event.offsetX - SIDE) / (strip.clientWidth - 2 * SIDE)) * end_s);
      strip.addEventListener("pointerdown", (event) => {
        strip.setPointerCapture(event.pointerId);
        seek(event);
      });
      strip.addEventListener("pointermove", (event) => strip.hasPointerCapture(event.pointerId) && seek(event));
    }

    function row(name) {
      const element = document.createElement("div");
      element.className = "row";
      const cells = Array.from({ length: head.heads }, () => "<i></i>").join("");
      element.innerHTML = `<span class="name"></span><canvas class="strip"></canvas>
        <span class="values"><span class="pair"><i></i><i></i></span><span class="numbers"><span></span><span></span></span><span class="heads">${cells}</span></span>`;
      const find = (selector) => element.querySelector(selector);
      find(".name").textContent = name.replaceAll("_", " ");
      return {
        element,
        name: find(".name"),
        strip: find(".strip"),
        bars: element.querySelectorAll(".pair i"),
        numbers: element.querySelectorAll(".numbers span"),
        heads: element.querySelectorAll(".heads i"),
      };
    }

    const share = (i, g) => {
      let sum = 0;
      for (let one = 0; one < head.heads; one++) sum += looks.attention(i, layer, one, g);
      return sum / Math.max(head.heads, 1);
    };

    // What a row's height stands for: nearly the largest value, as single peaks would flatten the rest
    function scales() {
      const value = mode === "gradient" ? (i, g) => Math.max(...looks.gradient(i, g)) : share;
      const each = groups.map((_, g) => Array.from({ length: looks.count }, (_, i) => value(i, g)));
      if (own) return each.map(nearly_largest);
      return each.fill(nearly_largest(each.flat()));
    }

    function paint() {
      const style = getComputedStyle(element);
      const most_of = scales();
      const colour = (name) => style.getPropertyValue(`--${name}`).trim();
      rows.forEach(({ strip }, g) => {
        const ratio = globalThis.devicePixelRatio || 1;
        const width = strip.clientWidth;
        Object.assign(strip, { width: Math.round(width * ratio), height: Math.round(HEIGHT * ratio) });
        const context = strip.getContext("2d");
        context.scale(ratio, ratio);
        const x = (time_s) => SIDE + ((width - 2 * SIDE) * time_s) / end_s;
        for (const { time_s, name } of marks) {
          context.fillStyle = colour(name);
          context.globalAlpha = 0.45;
          context.fillRect(x(time_s) - 0.75, 0, 1.5, HEIGHT);
        }
        context.globalAlpha = 1;
        const most = most_of[g];
        const middle = mode === "gradient" ? HEIGHT / 2 : HEIGHT - 2;
        const reach = mode === "gradient" ? HEIGHT / 2 - 2 : HEIGHT - 4;
        context.fillStyle = colour("rule");
        context.fillRect(SIDE, middle - 0.5, width - 2 * SIDE, 1);
        const area = (value, up, name) => {
          context.beginPath();
          context.moveTo(x(looks.times[0]), middle);
          for (let i = 0; i < looks.count; i++) {
            const y = middle - up * reach * Math.min(1, value(i) / most);
            context.lineTo(x(looks.times[i]), y);
            context.lineTo(x(looks.times[i + 1] ?? end_s), y);
          }
          context.lineTo(x(end_s), middle);
          context.fillStyle = colour(name);
          context.fill();
        };
        if (mode === "gradient") {
          area((i) => looks.gradient(i, g)[0], 1, "gx");
          area((i) => looks.gradient(i, g)[1], -1, "gy");
        } else {
          area((i) => share(i, g), 1, "attention");
        }
      });
      tell(now);
    }

    function tell(time_s) {
      now = time_s;
      const i = looks.place(time_s);
      const first = rows[0].strip;
      cursor.style.left = `${first.offsetLeft + SIDE + ((first.clientWidth - 2 * SIDE) * time_s) / end_s}px`;
      const most = Math.max(...groups.flatMap((_, g) => looks.gradient(i, g))) || 1;
      rows.forEach(({ bars, numbers, heads }, g) => {
        looks.gradient(i, g).forEach((value, c) => {
          bars[c].style.width = `${(100 * value) / most}%`;
          numbers[c].textContent = short(value);
        });
        heads.forEach((cell, one) => {
          const value = looks.attention(i, layer, one, g);
          cell.style.background = `color-mix(in srgb, var(--attention) ${Math.round(100 * value ** 0.6)}%, transparent)`;
          cell.title = `head ${one + 1}: ${(100 * value).toFixed(1)} %`;
        });
      });
    }

    new ResizeObserver(paint).observe(element);
    return {
      tell,
      paint,
      mode(name) {
        mode = name;
        paint();
      },
      own_scale(yes) {
        own = yes;
        paint();
      },
      layer(number) {
        layer = number;
        paint();
      },
      dropped(names) {
        rows.forEach(({ name }, g) => name.classList.toggle("dropped", names.includes(groups[g])));
      },
    };
  }

  function nearly_largest(values) {
    const sorted = values.toSorted((one, other) => one - other);
    return sorted[Math.floor(NEARLY * (sorted.length - 1))] || sorted[sorted.length - 1] || 1;
  }

  function short(value) {
    if (value === 0) return "0";
    return value < 0.001 ? value.toExponential(0) : value.toPrecision(2);
  }

  di.rows = { on };
})((globalThis.driveinsight ??= {}));
