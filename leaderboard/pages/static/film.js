"use strict";
// A route's film: what there was to see at a time, between its moments too.
//
// const film = di.film.of(await di.blocks.read(text))
// film.end_s, film.at(time_s) -> {time_s, moment, ego, actors, lights, control, score, ...}
// di.film.kmh(metres_a_second): as people read it

(function (di) {
  const ABOVE = 1, BRAKES = 2, LEFT = 4, RIGHT = 8, LIES = 16; // bits of an actor's flags
  const JUMP_M = 4; // who is that much further a moment later was set down there: no way between

  function of({ meta, columns }) {
    const times = columns.tick.map((tick) => tick * meta.tick_s);
    return {
      meta,
      end_s: times[times.length - 1],
      route: route(columns),
      tracks: tracks(columns, meta),
      lights: lights(columns),
      columns,
      times,
      at(time_s) {
        return moment(this, Math.min(Math.max(time_s, 0), this.end_s));
      },
    };
  }

  function route(columns) {
    return {
      x: columns.route_x,
      y: columns.route_y,
      flags: columns.route_flags,
      targets: columns.targets,
    };
  }

  function tracks(columns, meta) {
    const found = [];
    let start = 0;
    for (let i = 0; i < columns.track_actor.length; i++) {
      found.push({
        actor: columns.track_actor[i],
        kind: meta.kinds[columns.track_kind[i]],
        from: columns.track_moment[i],
        until: columns.track_moment[i] + columns.track_count[i], // the moment after its last
        start, // of its numbers in the columns of all actors
        half_length: columns.track_half_length[i],
        half_width: columns.track_half_width[i],
      });
      start += columns.track_count[i];
    }
    return found.sort((one, other) => one.from - other.from);
  }

  // For each light the moments at which it changed, and to what
  function lights(columns) {
    const by_light = new Map();
    for (let i = 0; i < columns.light.length; i++) {
      const light = columns.light[i];
      if (!by_light.has(light)) by_light.set(light, { moments: [], states: [] });
      by_light.get(light).moments.push(columns.light_moment[i]);
      by_light.get(light).states.push(columns.light_state[i]);
    }
    return by_light;
  }

  function moment(film, time_s) {
    const { columns, times } = film;
    const now = last_at(times, time_s);
    const next = Math.min(now + 1, times.length - 1);
    const share = next > now ? (time_s - times[now]) / (times[next] - times[now]) : 0;
    const held = Math.min(now + 1, times.length - 1); // a moment's control led to it
    return {
      time_s,
      moment: now,
      ego: {
        ...pose(columns.ego_x, columns.ego_y, columns.ego_yaw, now, next, share),
        flags: columns.ego_flags[now],
        speed: mix(columns.ego_speed, now, next, share),
        kind: "ego",
        half_length: 2.45,
        half_width: 1.06,
      },
      actors: actors(film, now, share),
      light: (light) => state_of(film.lights.get(light), now),
      throttle: columns.throttle[held],
      steer: columns.steer[held],
      brake: columns.brake[held],
      score: columns.score[now],
      completion: columns.completion[now],
      route_index: columns.route_index[now],
      target: columns.target[now],
    };
  }

  function actors(film, now, share) {
    const { actor_x, actor_y, actor_yaw, actor_flags } = film.columns;
    const there = [];
    for (const track of film.tracks) {
      if (track.from > now) break;
      if (track.until <= now) continue;
      const i = track.start + now - track.from;
      const next = now + 1 < track.until ? i + 1 : i;
      there.push({
        ...pose(actor_x, actor_y, actor_yaw, i, next, share),
        flags: actor_flags[i],
        kind: track.kind,
        actor: track.actor,
        half_length: track.half_length,
        half_width: track.half_width,
      });
    }
    return there;
  }

  function pose(x, y, yaw, i, next, share) {
    const jumps = Math.hypot(x[next] - x[i], y[next] - y[i]) > JUMP_M;
    const part = jumps ? 0 : share;
    return { x: mix(x, i, next, part), y: mix(y, i, next, part), yaw: mix(yaw, i, next, part) };
  }

  function mix(values, i, next, share) {
    return values[i] + (values[next] - values[i]) * share;
  }

  function state_of(light, moment) {
    if (!light) return 0;
    const index = last_at(light.moments, moment);
    return light.moments[index] <= moment ? light.states[index] : 0;
  }

  // Index of the last of ascending values that is not above the given one, 0 where all are
  function last_at(values, value) {
    let low = 0;
    let high = values.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (values[middle] <= value + 1e-9) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  function kmh(speed) {
    const tenths = Math.round(36 * speed) || 0; // who stands may roll back by a hair: not -0.0
    return `${(tenths / 10).toFixed(1)} km/h`;
  }

  di.film = { of, kmh, ABOVE, BRAKES, LEFT, RIGHT, LIES };
})((globalThis.driveinsight ??= {}));
