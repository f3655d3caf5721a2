"use strict";
// Plays a film on a canvas: time, camera, pointer. Knows nothing of the page around it.
//
// const player = di.player.on(canvas, town, {on_time, layers, turns})
//   layers: what else is drawn, see scene.js; turns: whether the picture turns with the ego
// player.show(film, time_s), player.seek(time_s), player.step(seconds), player.toggle(),
// player.speed(factor), player.zoom(factor), player.follow(), player.turn(), player.paint();
// player.time_s, player.playing, player.turns

(function (di) {
  const SCALE = 7, SMALLEST = 1, LARGEST = 40; // pixels a metre

  const LEAD = 0.22; // of the canvas's height: the ego stands that much lower where all turns with it

  function on(canvas, town, { on_time = () => {}, layers = {}, turns = false } = {}) {
    const context = canvas.getContext("2d");
    const camera = { x: 0, y: 0, scale: SCALE, turn: 0 };
    const bar = canvas.parentElement.querySelector(".scale");
    const away = { x: 0, y: 0 }; // from the ego, by dragging [m]
    let colours = di.scene.look(canvas);
    let film = null;
    let time_s = 0;
    let factor = 1;
    let playing = false;
    let before = 0;
    let asked = false;

    function ask() {
      if (!asked) {
        asked = true;
        requestAnimationFrame(frame);
      }
    }

    function frame(now_ms) {
      asked = false;
      if (film === null) return;
      if (playing) {
        time_s = Math.min(film.end_s, time_s + (factor * Math.min(now_ms - before, 200)) / 1000);
        before = now_ms;
        if (time_s >= film.end_s) playing = false;
      }
      paint();
      if (playing) ask();
    }

    function paint() {
      const size = { width: canvas.clientWidth, height: canvas.clientHeight };
      const ratio = globalThis.devicePixelRatio || 1;
      const [width, height] = [Math.round(size.width * ratio), Math.round(size.height * ratio)];
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
      if (!width || !height) return;
      const now = film.at(time_s);
      aim(camera, now.ego, turns ? LEAD * size.height : 0, turns);
      camera.x += away.x;
      camera.y += away.y;
      di.scene.draw(context, size, { town, film, now, camera, look: colours, layers });
      di.scale.show(bar, camera.scale);
      on_time(now, playing);
    }

    const player = {
      show(other, at_s = 0) {
        film = other;
        playing = false;
        away.x = away.y = 0;
        player.seek(at_s);
      },
      seek(at_s) {
        if (film === null) return;
        time_s = Math.min(Math.max(at_s, 0), film.end_s);
        paint();
      },
      step(seconds) {
        playing = false;
        player.seek(time_s + seconds);
      },
      toggle() {
        if (film === null) return;
        playing = !playing;
        if (playing && time_s >= film.end_s) time_s = 0;
        before = performance.now();
        ask();
      },
      speed(other) {
        factor = other;
      },
      zoom(by) {
        camera.scale = Math.min(Math.max(camera.scale * by, SMALLEST), LARGEST);
        ask();
      },
      turn() {
        turns = !turns;
        away.x = away.y = 0;
        ask();
        return turns;
      },
      paint: ask,
      follow() {
        away.x = away.y = 0;
        ask();
      },
      get time_s() {
        return time_s;
      },
      get playing() {
        return playing;
      },
      get turns() {
        return turns;
      },
    };

    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      player.zoom(Math.exp(-event.deltaY * 0.0015));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!canvas.hasPointerCapture(event.pointerId)) return;
      const [cos, sin] = [Math.cos(camera.turn), Math.sin(camera.turn)];
      away.x -= (cos * event.movementX + sin * event.movementY) / camera.scale;
      away.y -= (cos * event.movementY - sin * event.movementX) / camera.scale;
      ask();
    });
    new ResizeObserver(ask).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      colours = di.scene.look(canvas);
      ask();
    });
    return player;
  }

  // Looks at an ego from above: north up, or its heading up and some pixels more of what is ahead
  function aim(camera, ego, lead_px, turns) {
    camera.turn = turns ? -ego.yaw - Math.PI / 2 : 0;
    camera.x = ego.x + (Math.cos(ego.yaw) * lead_px) / camera.scale;
    camera.y = ego.y + (Math.sin(ego.yaw) * lead_px) / camera.scale;
  }

  di.player = { on, aim };
})((globalThis.driveinsight ??= {}));
