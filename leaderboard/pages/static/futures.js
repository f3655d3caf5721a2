"use strict";
// The futures of a moment side by side: a pane for each edit, all at the same time.
//
// di.futures.on({head, town, films, told}): panes, their bar and buttons

(function (di) {
  const by_id = (id) => document.getElementById(id);
  const SCALE = 6; // pixels a metre

  function on({ head, town, films, told }) {
    const { at_s, end_s, answers } = head.what_if;
    const panes = answers.map((answer, number) => pane(answer, number));
    by_id("panes").replaceChildren(...panes.map((one) => one.element));
    by_id("what-if-title").textContent = `What if, at ${at_s.toFixed(1)} s`;
    const scrub = by_id("futures-scrub");
    Object.assign(scrub, { min: at_s, max: end_s, value: at_s });
    let [time_s, playing, before] = [at_s, false, 0];

    function paint() {
      scrub.value = time_s;
      by_id("futures-clock").textContent = `${time_s.toFixed(1)} s of ${at_s.toFixed(1)} to ${end_s.toFixed(1)}`;
      by_id("futures-play").textContent = playing ? "⏸" : "▶";
      for (const one of panes) draw(one);
      by_id("what-if").dataset.shown = time_s.toFixed(2);
    }

    function draw({ answer, number, canvas, caption }) {
      const film = films[number];
      const look = { ...di.scene.look(canvas), ...di.told.look(canvas) };
      const size = { width: canvas.clientWidth, height: canvas.clientHeight };
      const ratio = globalThis.devicePixelRatio || 1;
      Object.assign(canvas, { width: Math.round(size.width * ratio), height: Math.round(size.height * ratio) });
      if (!canvas.width) return;
      const now = film.at(time_s);
      const start = film.at(at_s).ego;
      const camera = { x: 0, y: 0, scale: SCALE, turn: 0 };
      di.player.aim(camera, now.ego, 0.25 * size.height, true);
      const begins = time_s <= at_s + 0.01;
      const layers = {
        way: () => !(begins && told[number]),
        over(context) {
          if (begins && told[number]) told[number].draw(context, 0, start, camera, look);
          const edge = look["path-edge"];
          if (number > 0) di.told.path(context, answers[0].waypoints, start, camera, { fill: look["path-base"], edge, dashed: true });
          di.told.path(context, answer.waypoints, start, camera, { fill: look.path, edge });
          if (number > 0) ghost(context, films[0].at(time_s).ego, camera, look);
        },
      };
      di.scene.draw(canvas.getContext("2d"), size, { town, film, now, camera, look, layers });
      tell(answer, caption, now, film);
    }

    function tell(answer, caption, now, film) {
      const over = time_s > film.end_s + 0.01;
      const [throttle, steer, brake] = answer.control ?? [];
      const first = answer.control === null ? "the agent fails" : `throttle ${throttle.toFixed(2)} · steer ${steer.toFixed(2)} · brake ${brake.toFixed(2)}`;
      const last = answer.events.filter((event) => event.time_s <= time_s + 0.01).at(-1);
      const ends = over ? `over at ${film.end_s.toFixed(1)} s${answer.status ? `: ${answer.status}` : ""}` : di.film.kmh(now.ego.speed);
      caption.innerHTML = "<span></span><br><b></b><br><span></span>";
      caption.children[0].textContent = first;
      caption.children[2].textContent = `${ends}, score ${now.score.toFixed(1)}`;
      caption.children[4].textContent = last ? `${last.time_s} s: ${last.text}` : "";
    }

    function frame(now_ms) {
      if (!playing) return;
      time_s = Math.min(end_s, time_s + Math.min(now_ms - before, 200) / 1000);
      before = now_ms;
      if (time_s >= end_s) playing = false;
      paint();
      requestAnimationFrame(frame);
    }

    scrub.addEventListener("input", () => {
      playing = false;
      time_s = Number(scrub.value);
      paint();
    });
    by_id("futures-play").addEventListener("click", () => {
      playing = !playing;
      if (playing && time_s >= end_s) time_s = at_s;
      before = performance.now();
      paint();
      requestAnimationFrame(frame);
    });
    new ResizeObserver(paint).observe(by_id("panes"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
    paint();
  }

  function pane(answer, number) {
    const element = document.createElement("figure");
    element.className = "pane";
    element.innerHTML = "<h3></h3><canvas role=\"img\"></canvas><figcaption></figcaption>";
    const [title, canvas, caption] = element.children;
    title.textContent = answer.edit || "as it was";
    title.classList.toggle("base", number === 0);
    canvas.setAttribute("aria-label", `The streets around the ego, ${title.textContent}`);
    return { element, answer, number, canvas, caption };
  }

  function ghost(context, ego, camera, look) {
    context.save();
    context.translate(ego.x, ego.y);
    context.rotate(ego.yaw);
    context.strokeStyle = look["path-base"];
    context.lineWidth = 1.5 / camera.scale;
    context.strokeRect(-ego.half_length, -ego.half_width, 2 * ego.half_length, 2 * ego.half_width);
    context.restore();
  }

  di.futures = { on };
})((globalThis.driveinsight ??= {}));
