"use strict";
// The report's page: brings tables, map, player and the address's fragment together.
//
// `#route=3&seed=0&t=12.5` opens that moment. Data: the JSON in #report and the blocks beside it,
// described in docs/report.md.

(function (di) {
  const by_id = (id) => document.getElementById(id);
  const report = JSON.parse(by_id("report").textContent);
  const films = new Map(); // by block
  let shown = null; // the route that the player shows
  let naming = 0; // a timer

  di.tables.enhance(document);
  di.overview.enhance(by_id("map"));
  di.overview.legend(by_id("map"), by_id("legend"), (kind) => kind.replaceAll("_", " "));

  const playable = report.routes.filter((route) => route.block !== null);
  if (playable.length === 0) return;
  by_id("replay").hidden = false;
  const player = di.player.on(by_id("canvas"), di.town.of(by_id("town")), { on_time: tell });

  for (const [index, route] of report.routes.entries()) {
    const option = new Option(`${route.route}, seed ${route.seed}: DS ${route.driving_score.toFixed(1)}, ${route.status}`, String(index));
    option.disabled = route.block === null;
    by_id("choice").append(option);
  }

  // ---- which moment of which route

  function wanted() {
    const given = new URLSearchParams(location.hash.slice(1));
    const seed = given.get("seed");
    const route = playable.find((one) => one.route === given.get("route") && (seed === null || String(one.seed) === seed));
    return { route, time_s: Number(given.get("t")) || 0 };
  }

  async function open(route, time_s) {
    try {
      if (!films.has(route.block)) {
        films.set(route.block, di.film.of(await di.blocks.read(by_id(route.block).textContent)));
      }
    } catch (error) {
      by_id("stage-note").hidden = false;
      by_id("stage-note").textContent = error.message;
      return;
    }
    const film = films.get(route.block);
    if (route !== shown) {
      shown = route;
      set_up(route, film);
    }
    player.show(film, time_s);
    document.body.dataset.shown = `${route.route} ${route.seed} ${player.time_s.toFixed(2)}`;
  }

  function set_up(route, film) {
    by_id("replay-title").textContent = `Replay of route ${route.route}`;
    by_id("choice").value = String(report.routes.indexOf(route));
    by_id("scrub").max = film.end_s;
    by_id("ticks").replaceChildren(...route.events.map((event) => tick(event, film.end_s)));
    by_id("event-list").replaceChildren(...route.events.map(line));
    for (const row of document.querySelectorAll("#routes tbody tr")) {
      const link = row.querySelector("a");
      row.classList.toggle("shown", link !== null && link.hash === `#route=${route.route}&seed=${route.seed}&t=0.00`);
    }
  }

  function tick(event, end_s) {
    const mark = document.createElement("i");
    mark.className = `kind-${event.kind}${event.counts ? "" : " minor"}`;
    mark.style.left = `${(100 * event.time_s) / end_s}%`;
    return mark;
  }

  function line(event) {
    const item = document.createElement("li");
    const button = document.createElement("button");
    button.type = "button";
    button.className = event.counts ? "counts" : "";
    button.innerHTML = `<span class="dot kind-${event.kind}"></span><time></time><span></span>`;
    button.children[1].textContent = `${event.time_s.toFixed(1)} s`;
    button.children[2].textContent = event.with ? `${event.text} (${event.with})` : event.text;
    button.addEventListener("click", () => jump(event.time_s));
    item.append(button);
    item.dataset.time = event.time_s;
    return item;
  }

  function jump(time_s) {
    player.step(time_s - player.time_s);
  }

  // ---- what is told of the moment

  function tell(now, playing) {
    const { end_s } = films.get(shown.block);
    by_id("now-time").textContent = `${now.time_s.toFixed(1)} s`;
    by_id("now-speed").textContent = `${(3.6 * now.ego.speed).toFixed(1)} km/h`;
    by_id("now-done").textContent = `${now.completion.toFixed(1)} %`;
    by_id("now-score").textContent = now.score.toFixed(1);
    bar("throttle", now.throttle, false);
    bar("brake", now.brake, false);
    bar("steer", now.steer, true);
    by_id("scrub").value = now.time_s;
    by_id("scrub").setAttribute("aria-valuetext", `${now.time_s.toFixed(1)} seconds`);
    by_id("clock").textContent = `${clock(now.time_s)} / ${clock(end_s)}`;
    by_id("play").textContent = playing ? "⏸" : "▶";
    by_id("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    tell_events(now.time_s);
    clearTimeout(naming);
    if (!playing) naming = setTimeout(name_moment, 400, now.time_s);
  }

  // Once it stands still the address names the moment, to be copied
  function name_moment(time_s) {
    const place = `#route=${shown.route}&seed=${shown.seed}&t=${time_s.toFixed(2)}`;
    history.replaceState(null, "", place);
  }

  // What has happened is bold, and the last of it in sight
  function tell_events(time_s) {
    const list = by_id("event-list");
    let last = null;
    for (const item of list.children) {
      const past = Number(item.dataset.time) <= time_s + 0.01;
      item.classList.toggle("past", past);
      if (past) last = item;
    }
    if (last === list.current) return;
    list.current = last;
    const top = last === null ? 0 : last.offsetTop - list.offsetTop;
    list.scrollTop = top - list.clientHeight / 2;
  }

  function bar(name, value, both_ways) {
    const fill = by_id(`bar-${name}`);
    fill.style.left = both_ways ? `${50 + Math.min(50 * value, 0)}%` : "0";
    fill.style.width = `${Math.abs(value) * (both_ways ? 50 : 100)}%`;
    by_id(`value-${name}`).textContent = value.toFixed(2);
  }

  function clock(time_s) {
    const minutes = Math.floor(time_s / 60);
    return `${minutes}:${(time_s - 60 * minutes).toFixed(1).padStart(4, "0")}`;
  }

  // ---- what people do

  by_id("play").addEventListener("click", () => player.toggle());
  by_id("scrub").addEventListener("input", () => jump(Number(by_id("scrub").value)));
  by_id("zoom-in").addEventListener("click", () => player.zoom(1.4));
  by_id("zoom-out").addEventListener("click", () => player.zoom(1 / 1.4));
  by_id("follow").addEventListener("click", () => player.follow());
  by_id("choice").addEventListener("change", () => {
    const route = report.routes[Number(by_id("choice").value)];
    location.hash = `route=${route.route}&seed=${route.seed}&t=0`;
  });
  for (const button of document.querySelectorAll("[data-speed]")) {
    button.addEventListener("click", () => {
      player.speed(Number(button.dataset.speed));
      for (const other of document.querySelectorAll("[data-speed]")) {
        other.setAttribute("aria-pressed", String(other === button));
      }
    });
  }

  const KEYS = {
    " ": () => player.toggle(),
    ArrowLeft: (event) => player.step(event.shiftKey ? -5 : -0.1),
    ArrowRight: (event) => player.step(event.shiftKey ? 5 : 0.1),
    Home: () => player.step(-Infinity),
    n: () => jump_to_event(1),
    p: () => jump_to_event(-1),
    f: () => player.follow(),
    "+": () => player.zoom(1.4),
    "-": () => player.zoom(1 / 1.4),
  };

  function jump_to_event(direction) {
    const times = shown.events.map((event) => event.time_s);
    const later = direction > 0 ? times.filter((time) => time > player.time_s + 0.01) : times.filter((time) => time < player.time_s - 0.01);
    if (later.length) jump(direction > 0 ? Math.min(...later) : Math.max(...later));
  }

  addEventListener("keydown", (event) => {
    const name = event.target.tagName;
    const own = name === "SELECT" || name === "BUTTON" || name === "A" || name === "SUMMARY";
    if (event.ctrlKey || event.altKey || event.metaKey || (own && event.key === " ")) return;
    if (name === "SELECT" || !(event.key in KEYS) || shown === null) return;
    event.preventDefault();
    KEYS[event.key](event);
  });

  async function follow_address({ look }) {
    const { route, time_s } = wanted();
    await open(route ?? shown ?? playable[0], time_s);
    if (look && route) by_id("replay").scrollIntoView({ block: "start" });
  }

  addEventListener("hashchange", () => follow_address({ look: true }));
  follow_address({ look: false });
})((globalThis.driveinsight ??= {}));
