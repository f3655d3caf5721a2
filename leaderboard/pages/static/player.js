"use strict";
// Plays a film on a canvas: time, camera, pointer. Knows nothing of the page around it.
//
// const player = di.player.on(canvas, town, {on_time})
// player.show(film, time_s), player.seek(time_s), player.step(seconds), player.toggle(),
// player.speed(factor), player.zoom(factor), player.follow(); player.time_s, player.playing

(function (di) {
  const SCALE = 7, SMALLEST = 1, LARGEST = 40; // pixels a metre

  function on(canvas, town, { on_time = () => {} } = {}) {
    const context = canvas.getContext("2d");
    const camera = { x: 0, y: 0, scale: SCALE };
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
      camera.x = now.ego.x + away.x;
      camera.y = now.ego.y + away.y;
      di.scene.draw(context, size, { town, film, now, camera, look: colours });
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
    };

    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      player.zoom(Math.exp(-event.deltaY * 0.0015));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!canvas.hasPointerCapture(event.pointerId)) return;
      away.x -= event.movementX / camera.scale;
      away.y -= event.movementY / camera.scale;
      ask();
    });
    new ResizeObserver(ask).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      colours = di.scene.look(canvas);
      ask();
    });
    return player;
  }

  di.player = { on };
})((globalThis.driveinsight ??= {}));
