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
  const transport = di.transport.of(player);

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

  // Routes stand worst first: what went wrong first in the worst of those in which something did
  function first_infraction() {
    for (const route of playable) {
      const event = route.events.find((one) => one.counts);
      if (event) return [route, event.time_s];
    }
    return [playable[0], 0];
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
    transport.show(route.events, film.end_s);
    for (const row of document.querySelectorAll("#routes tbody tr")) {
      const link = row.querySelector("a");
      row.classList.toggle("shown", link !== null && link.hash === `#route=${route.route}&seed=${route.seed}&t=0.00`);
    }
  }

  // ---- what is told of the moment

  function tell(now, playing) {
    transport.tell(now, playing);
    clearTimeout(naming);
    if (!playing) naming = setTimeout(name_moment, 400, now.time_s);
  }

  // Once it stands still the address names the moment, to be copied
  function name_moment(time_s) {
    const place = `#route=${shown.route}&seed=${shown.seed}&t=${time_s.toFixed(2)}`;
    history.replaceState(null, "", place);
  }

  // ---- what people do

  by_id("choice").addEventListener("change", () => {
    const route = report.routes[Number(by_id("choice").value)];
    location.hash = `route=${route.route}&seed=${route.seed}&t=0`;
  });

  async function follow_address({ look }) {
    const { route, time_s } = wanted();
    if (route || shown) await open(route ?? shown, time_s);
    else await open(...first_infraction());
    if (look && route) by_id("replay").scrollIntoView({ block: "start" });
  }

  addEventListener("hashchange", () => follow_address({ look: true }));
  follow_address({ look: false });
})((globalThis.driveinsight ??= {}));
