"use strict";
// Draws what an agent is told, and the path that it predicts, over the streets. Metres.
//
// const told = di.told.of(head, block)
// told.draw(context, i, pose, camera, look), told.facts(i) -> [{name, text, given}]
// di.told.path(context, points, pose, camera, {fill, edge, dashed})
// di.told.ground(context, map, i, pose): an activation map on the ground; di.told.look(element)

(function (di) {
  const COLOURS = ["told-routing", "told-lane", "told-line", "told-obstacle", "told-stop", "path", "path-base", "path-edge"];
  const STATES = ["none", "green", "yellow", "red"];
  const LANE_HALF_M = 1.6;

  function look(element) {
    const style = getComputedStyle(element);
    return Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }

  function of(head, { columns }) {
    const starts = Object.fromEntries(
      ["routing", "obstacles", "traffic_lights", "stop_signs", "map"].map((name) => [name, sums(columns[`${name}_count`])]),
    );
    const line_starts = sums(columns.line_count);
    const given = (i, name) => columns.present[i * head.components.length + head.components.indexOf(name)] === 1;

    function* rows(name, i) {
      for (let row = starts[name][i]; row < starts[name][i + 1]; row++) yield row;
    }

    function lines(context, i, px, look) {
      for (const place of rows("map", i)) {
        const line = columns.map_line[place];
        context.beginPath();
        for (let p = line_starts[line]; p < line_starts[line + 1]; p++) context.lineTo(columns.line_x[p], columns.line_y[p]);
        context.strokeStyle = columns.line_kind[line] === 1 ? look["told-lane"] : look["told-line"];
        context.lineWidth = (columns.line_kind[line] === 1 ? 1.6 : 1.1) * px;
        context.setLineDash(columns.line_kind[line] === 2 ? [6 * px, 4 * px] : []);
        context.stroke();
      }
      context.setLineDash([]);
    }

    function bar(context, name, row, colour, px) {
      const [x, y, yaw] = ["x", "y", "yaw"].map((part) => columns[`${name}_${part}`][row]);
      const [across_x, across_y] = [-Math.sin(yaw) * LANE_HALF_M, Math.cos(yaw) * LANE_HALF_M];
      for (const [width, paint] of [[Math.max(1.1, 6 * px), "#101418"], [Math.max(0.7, 4 * px), colour]]) {
        context.beginPath();
        context.moveTo(x - across_x, y - across_y);
        context.lineTo(x + across_x, y + across_y);
        context.lineWidth = width;
        context.strokeStyle = paint;
        context.stroke();
      }
    }

    function obstacles(context, i, px, look) {
      context.strokeStyle = look["told-obstacle"];
      for (const row of rows("obstacles", i)) {
        const part = (name) => columns[`obstacles_${name}`][row];
        context.lineWidth = 2 * px;
        context.save();
        context.translate(part("x"), part("y"));
        if (Math.hypot(part("vx"), part("vy")) > 0.3) {
          context.beginPath();
          context.moveTo(0, 0);
          context.lineTo(part("vx"), part("vy"));
          context.stroke();
        }
        context.rotate(part("yaw"));
        const [length, width] = [Math.max(part("length"), 8 * px), Math.max(part("width"), 8 * px)];
        context.strokeRect(-length / 2 - px, -width / 2 - px, length + 2 * px, width + 2 * px);
        context.restore();
      }
    }

    function way(context, i, px, look) {
      context.fillStyle = context.strokeStyle = look["told-routing"];
      for (const row of rows("routing", i)) {
        context.beginPath();
        context.arc(columns.routing_x[row], columns.routing_y[row], 1.8 * px, 0, 2 * Math.PI);
        context.fill();
      }
      if (!given(i, "target_point")) return;
      const [x, y, yaw] = [columns.target_x[i], columns.target_y[i], columns.target_yaw[i]];
      context.lineWidth = 2.5 * px;
      context.beginPath();
      context.arc(x, y, 7 * px, 0, 2 * Math.PI);
      context.moveTo(x, y);
      context.lineTo(x + 15 * px * Math.cos(yaw), y + 15 * px * Math.sin(yaw));
      context.stroke();
    }

    return {
      given,
      draw(context, i, pose, camera, look) {
        const px = 1 / camera.scale;
        context.save();
        if (given(i, "map")) lines(context, i, px, look);
        to_ego(context, pose);
        if (given(i, "stop_signs")) for (const row of rows("stop_signs", i)) bar(context, "stop_signs", row, look["told-stop"], px);
        if (given(i, "traffic_lights")) {
          for (const row of rows("traffic_lights", i)) bar(context, "traffic_lights", row, look[`light-${STATES[columns.traffic_lights_state[row]]}`], px);
        }
        if (given(i, "obstacles")) obstacles(context, i, px, look);
        if (given(i, "routing")) way(context, i, px, look);
        context.restore();
      },
      facts(i) {
        const count = (name) => starts[name][i + 1] - starts[name][i];
        const lights = [...rows("traffic_lights", i)].map((row) => STATES[columns.traffic_lights_state[row]]);
        const text = {
          command: head.commands[columns.command[i]] ?? String(columns.command[i]),
          target_point: `${columns.target_x[i].toFixed(1)} m ahead, ${signed(columns.target_y[i])} m right`,
          routing: `${count("routing")} points`,
          map: `${count("map")} lines`,
          obstacles: String(count("obstacles")),
          traffic_lights: lights.length ? STATES.map((state) => [lights.filter((one) => one === state).length, state]).filter(([n]) => n).map(([n, state]) => `${n} ${state}`).join(", ") : "0",
          stop_signs: String(count("stop_signs")),
          speed: di.film.kmh(columns.speed[i]),
        };
        return Object.entries(text).map(([name, value]) => ({ name, text: value, given: given(i, name) }));
      },
    };
  }

  function signed(value) {
    return `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(1)}`;
  }

  // Where each moment's rows begin, and where the last ones end
  function sums(counts) {
    const starts = new Float64Array(counts.length + 1);
    for (let i = 0; i < counts.length; i++) starts[i + 1] = starts[i] + counts[i];
    return starts;
  }

  function to_ego(context, pose) {
    context.translate(pose.x, pose.y);
    context.rotate(pose.yaw);
  }

  function path(context, points, pose, camera, { fill, edge, dashed = false }) {
    if (points.length === 0) return;
    const px = 1 / camera.scale;
    context.save();
    to_ego(context, pose);
    context.lineJoin = context.lineCap = "round";
    for (const [width, colour] of [[5, edge], [2.5, fill]]) {
      context.beginPath();
      context.moveTo(0, 0);
      for (const [x, y] of points) context.lineTo(x, y);
      context.setLineDash(dashed ? [5 * px, 5 * px] : []);
      context.lineWidth = width * px;
      context.strokeStyle = colour;
      context.stroke();
    }
    context.setLineDash([]);
    for (const [x, y] of points) {
      context.beginPath();
      context.arc(x, y, (dashed ? 2.5 : 4) * px, 0, 2 * Math.PI);
      context.fillStyle = fill;
      context.fill();
      context.lineWidth = px;
      context.strokeStyle = edge;
      context.stroke();
    }
    context.restore();
  }

  function ground(context, map, i, pose) {
    const [x_min, x_max, y_min, y_max] = map.entry.extent_m;
    context.save();
    to_ego(context, pose);
    context.drawImage(map.image(i), x_min, y_min, x_max - x_min, y_max - y_min);
    context.restore();
  }

  di.told = { of, path, ground, look };
})((globalThis.driveinsight ??= {}));
