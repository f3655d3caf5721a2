"use strict";
// Draws a moment of a film from above.
//
// di.scene.draw(context, size, {town, film, now, camera, look, layers})
//   size: {width, height} in CSS pixels; camera: {x, y, scale, turn} middle [m], pixels a metre, and
//   how far the picture is turned; look: colours by name, see di.scene.look(element);
//   layers: {under, over, way}: functions (context, now, camera, look) that draw in metres on the
//   streets and above all, and one that says whether the route is drawn

(function (di) {
  const { ABOVE, BRAKES, LEFT, RIGHT, LIES } = di.film;
  const HALF_HEIGHT = 0.85; // of people, and of two wheels with their riders, as they lie [m]
  const LINES = { solid: [18, []], broken: [18, [200, 200]], rim: [90, []] };
  const SEAM = 12; // surfaces reach that much over their edge, so that none shows between two
  const ACTORS = ["car", "van", "truck", "bus", "motorcycle", "bicycle", "walker"];
  const COLOURS = [
    ...["land", "sidewalk", "shoulder", "parking", "driving", "bar", "solid", "broken", "rim"],
    ...["route", "target", "ego", "edge", "brake", "indicator", "debris", "vending_machine", "text"],
    ...ACTORS,
  ];
  const LIGHTS = ["none", "green", "yellow", "red"];

  // The colours that the style sheet gives, which differ between light and dark
  function look(element) {
    const style = getComputedStyle(element);
    const names = [...COLOURS, ...LIGHTS.map((name) => `light-${name}`)];
    return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }

  function draw(context, size, { town, film, now, camera, look, layers = {} }) {
    const ratio = context.canvas.width / size.width;
    const to_pixels = () => {
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.translate(size.width / 2, size.height / 2);
      context.scale(camera.scale, camera.scale);
      context.rotate(camera.turn ?? 0);
      context.translate(-camera.x, -camera.y);
    };
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = look.land;
    context.fillRect(0, 0, context.canvas.width, context.canvas.height);
    const round = Math.hypot(size.width, size.height); // what a turned window lies within
    const sides = camera.turn ? [round, round] : [size.width, size.height];
    const reach = sides.map((side) => side / 2 / camera.scale);
    const window_cm = [
      (camera.x - reach[0]) * 100, (camera.y - reach[1]) * 100,
      (camera.x + reach[0]) * 100, (camera.y + reach[1]) * 100,
    ];
    town.levels.forEach((level, above) => {
      to_pixels();
      context.scale(0.01, 0.01);
      streets(context, level, window_cm, look);
      stops(context, level, window_cm, now, look);
      to_pixels();
      if (Boolean(now.ego.flags & ABOVE) === Boolean(above)) layers.under?.(context, now, camera, look);
      if (layers.way?.() ?? true) way(context, film, now, above, camera, look);
      const walkers = now.actors.filter((actor) => actor.kind === "walker");
      const others = now.actors.filter((actor) => actor.kind !== "walker");
      for (const actor of [...others, now.ego, ...walkers]) {
        if (Boolean(actor.flags & ABOVE) === Boolean(above)) body(context, actor, camera, look, now.time_s);
      }
    });
    layers.over?.(context, now, camera, look);
  }

  function streets(context, level, window_cm, look) {
    for (const { name, box, path } of level.shapes) {
      if (apart(box, window_cm)) continue;
      if (name in LINES) {
        const [width, dashes] = LINES[name];
        context.strokeStyle = look[name];
        context.lineWidth = width;
        context.setLineDash(dashes);
        context.stroke(path);
      } else {
        context.fillStyle = context.strokeStyle = look[name];
        context.lineWidth = SEAM;
        context.fill(path);
        if (name !== "bar") context.stroke(path);
      }
    }
    context.setLineDash([]);
  }

  function stops(context, level, window_cm, now, look) {
    context.lineWidth = 70;
    for (const { light, path, box } of level.stops) {
      if (apart(box, window_cm)) continue;
      const state = light === null ? "none" : LIGHTS[now.light(light)];
      context.strokeStyle = look[`light-${state}`];
      context.stroke(path);
    }
  }

  function apart(box, other) {
    return box[0] > other[2] || box[2] < other[0] || box[1] > other[3] || box[3] < other[1];
  }

  // The route ahead, its target points and its end
  function way(context, film, now, above, camera, look) {
    const { x, y, flags, targets } = film.route;
    context.beginPath();
    let pen_down = false;
    for (let i = now.route_index; i < x.length; i++) {
      const here = Boolean(flags[i] & ABOVE) === Boolean(above);
      if (here && pen_down) context.lineTo(x[i], y[i]);
      else if (here) context.moveTo(x[i], y[i]);
      pen_down = here;
    }
    context.strokeStyle = look.route;
    context.lineWidth = 0.7;
    context.lineJoin = "round";
    context.globalAlpha = 0.85;
    context.stroke();
    context.globalAlpha = 1;
    const largest = 10 / camera.scale; // of a disc: so many pixels
    for (const i of targets) {
      if (i < now.route_index || Boolean(flags[i] & ABOVE) !== Boolean(above)) continue;
      const aim = i === now.target;
      disc(context, x[i], y[i], Math.min(aim ? 1.5 : 0.9, largest), aim ? look.route : look.target, aim ? look.target : look.route);
    }
    const last = x.length - 1;
    if (Boolean(flags[last] & ABOVE) === Boolean(above)) {
      disc(context, x[last], y[last], 2, look.target, look.route);
      disc(context, x[last], y[last], 1, look.route, look.route);
    }
  }

  function body(context, actor, camera, look, time_s) {
    const fill = look[actor.kind] ?? look.car;
    const walks = actor.kind === "walker", lies = actor.flags & LIES;
    if (walks && !lies) {
      disc(context, actor.x, actor.y, Math.max(0.45, 3 / camera.scale), fill, look.edge);
      return;
    }
    const l = walks ? HALF_HEIGHT : actor.half_length;
    const w = lies && !walks ? HALF_HEIGHT : actor.half_width;
    context.save();
    context.translate(actor.x, actor.y);
    context.rotate(actor.yaw);
    context.beginPath();
    const nose = actor.kind === "debris" || actor.kind === "vending_machine" ? l : 0.8 * l;
    context.moveTo(-l, -w);
    context.lineTo(-l, w);
    context.lineTo(nose, w);
    context.lineTo(l, 0.35 * w);
    context.lineTo(l, -0.35 * w);
    context.lineTo(nose, -w);
    context.closePath();
    context.fillStyle = fill;
    context.fill();
    context.strokeStyle = look.edge;
    context.lineWidth = Math.max(0.12, 1 / camera.scale);
    context.stroke();
    if (actor.flags & BRAKES) lamp(context, look.brake, [-l, -w, -l, w], 0.45);
    if (time_s % 0.8 < 0.4) {
      if (actor.flags & LEFT) lamp(context, look.indicator, [-l, -w, l, -w], 0.3);
      if (actor.flags & RIGHT) lamp(context, look.indicator, [-l, w, l, w], 0.3);
    }
    context.restore();
  }

  function lamp(context, colour, [x1, y1, x2, y2], width) {
    context.beginPath();
    context.moveTo(x1, y1);
    context.lineTo(x2, y2);
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
  }

  function disc(context, x, y, radius, fill, edge) {
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fillStyle = fill;
    context.fill();
    context.strokeStyle = edge;
    context.lineWidth = 0.25;
    context.stroke();
  }

  di.scene = { draw, look, disc };
})((globalThis.driveinsight ??= {}));
