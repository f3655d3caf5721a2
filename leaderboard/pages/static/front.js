"use strict";
// The front camera's pictures, with an activation map and the predicted path over them.
//
// const front = di.front.on(canvas, {sizes, bytes, camera}); front.show(i, {map, waypoints, look})

(function (di) {
  const KEPT = 24; // pictures that are ready

  function on(canvas, { sizes, bytes, camera }) {
    const context = canvas.getContext("2d");
    const starts = [0];
    for (const size of sizes) starts.push(starts[starts.length - 1] + size);
    const ready = new Map(); // by place
    let wanted = null;
    canvas.style.aspectRatio = `${camera.width} / ${camera.height}`;
    canvas.style.setProperty("--shape", camera.width / camera.height); // no higher than there is room

    function picture(i) {
      if (!ready.has(i)) {
        const blob = new Blob([bytes.subarray(starts[i], starts[i + 1])], { type: "image/jpeg" });
        ready.set(i, createImageBitmap(blob));
        if (ready.size > KEPT) ready.delete(ready.keys().next().value);
      }
      return ready.get(i);
    }

    async function show(i, over) {
      wanted = { i, over };
      const image = await picture(i);
      if (wanted.i !== i || wanted.over !== over) return;
      const ratio = globalThis.devicePixelRatio || 1;
      const width = Math.max(camera.width, Math.round(canvas.clientWidth * ratio));
      const height = Math.round((width * camera.height) / camera.width);
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
      context.setTransform(1, 0, 0, 1, 0, 0);
      context.imageSmoothingEnabled = true;
      context.drawImage(image, 0, 0, width, height);
      if (over.map) context.drawImage(over.map.image(i), 0, 0, width, height);
      if (over.waypoints) path(over.waypoints, width / camera.width, over.look);
      canvas.dataset.shown = String(i);
    }

    // Points on the ground ahead, where the camera sees them
    function path(points, scale, look) {
      const seen = points.map(project).filter((point) => point !== null);
      if (seen.length < 2) return;
      context.setTransform(scale, 0, 0, scale, 0, 0);
      context.lineJoin = context.lineCap = "round";
      for (const [width, colour] of [[3.6, look["path-edge"]], [1.8, look.path]]) {
        context.beginPath();
        for (const [column, row] of seen) context.lineTo(column, row);
        context.lineWidth = (width * camera.width) / 256;
        context.strokeStyle = colour;
        context.stroke();
      }
      context.fillStyle = look.path;
      for (const [column, row] of seen) {
        context.beginPath();
        context.arc(column, row, (2.2 * camera.width) / 256, 0, 2 * Math.PI);
        context.fill();
      }
    }

    function project([ahead, right]) {
      const [x, y, z] = [ahead - camera.x_m, right - camera.y_m, -camera.z_m];
      const [cos, sin] = [Math.cos(camera.yaw_rad), Math.sin(camera.yaw_rad)];
      const [forth, side] = [cos * x + sin * y, cos * y - sin * x];
      const [level, tilt] = [Math.cos(camera.pitch_rad), Math.sin(camera.pitch_rad)];
      const [depth, up] = [level * forth + tilt * z, level * z - tilt * forth];
      if (depth < 1) return null;
      const focal = camera.width / 2 / Math.tan((camera.fov_deg * Math.PI) / 360);
      return [camera.width / 2 + (focal * side) / depth, camera.height / 2 - (focal * up) / depth];
    }

    return { show };
  }

  di.front = { on };
})((globalThis.driveinsight ??= {}));
