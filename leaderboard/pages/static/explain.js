"use strict";
// The page of an explained route: brings its parts together.
//
// `#t=12.5` opens that moment. Data: the JSON in #explanation and the blocks beside it, described in
// docs/explain_page.md.

(async function (di) {
  const by_id = (id) => document.getElementById(id);
  const head = JSON.parse(by_id("explanation").textContent);
  const text = (name) => by_id(name).textContent;
  const has = (name) => head.blocks.includes(name);
  const read = async (name) => (has(name) ? di.blocks.read(text(name)) : null);
  by_id("drive").hidden = false;

  let data;
  try {
    data = await load();
  } catch (error) {
    by_id("stage-note").hidden = false;
    by_id("stage-note").textContent = error.message;
    return;
  }
  const { film, looks, told, maps, front } = data;
  const shows = (name) => by_id(`show-${name}`).checked;
  const bev = maps.find((map) => map.entry.extent_m !== null);
  const camera_map = maps.find((map) => map.entry.camera !== null);
  let colours = di.told.look(document.body);
  const in_window = window === window.top; // a frame, as in a notebook, has no address to name
  let naming = 0;

  const there = { told: told !== null, path: looks.has_responses, bev: Boolean(bev), camera: Boolean(camera_map && front) };
  for (const [name, yes] of Object.entries(there)) by_id(`layer-${name}`).hidden = !yes;
  by_id("front-figure").hidden = front === null;
  by_id("told-colours").hidden = told === null;
  by_id("heat-hint").hidden = maps.length === 0;
  by_id("heat-scales").replaceChildren(...maps.map(heat_scale));
  for (const [name, map] of [["bev", bev], ["camera", camera_map]]) {
    if (map) by_id(`show-${name}`).checked = map.entry.share >= map.entry.quiet;
  }
  di.tables.enhance(document);

  const layers = {
    way: () => !(there.told && shows("told")),
    under(context, now) {
      if (there.bev && shows("bev")) di.told.ground(context, bev, looks.place(now.time_s), pose(now));
    },
    over(context, now, camera, look) {
      const i = looks.place(now.time_s);
      if (there.told && shows("told")) told.draw(context, i, pose(now), camera, { ...look, ...colours });
      if (there.path && shows("path")) {
        di.told.path(context, looks.waypoints(i), pose(now), camera, { fill: colours.path, edge: colours["path-edge"] });
      }
    },
  };
  const town = di.town.of(by_id("town"));
  const player = di.player.on(by_id("canvas"), town, { on_time: tell, layers, turns: true });
  const transport = di.transport.of(player);
  const rows = looks.has_responses ? responses() : null;
  transport.show(head.events, film.end_s);
  if (head.what_if) await open_futures();
  const given = new URLSearchParams(location.hash.slice(1)).get("t");
  player.show(film, given === null ? head.open_at_s : Number(given) || 0);
  document.body.dataset.shown = player.time_s.toFixed(2);

  async function load() {
    const [film, looks, told, sizes] = await Promise.all(["film", "looks", "told", "image-sizes"].map(read));
    const maps = await Promise.all(head.maps.map(async (entry) => di.looks.map(entry, await read(entry.block))));
    const bytes = has("images") ? Uint8Array.from(atob(text("images").trim()), (letter) => letter.charCodeAt(0)) : null;
    return {
      film: di.film.of(film),
      looks: di.looks.of(head, looks),
      told: told && di.told.of(head, told),
      maps,
      front: bytes && di.front.on(by_id("front"), { sizes: sizes.columns.bytes, bytes, camera: head.camera }),
    };
  }

  // Where the ego was when the agent was last looked into: what it was told is of then
  function pose(now) {
    return film.at(looks.time_s(looks.place(now.time_s))).ego;
  }

  // A map's colours from none to its peak in the drive, with the numbers
  function heat_scale({ entry }) {
    const scale = document.createElement("span");
    scale.className = "heat-scale";
    scale.innerHTML = '<span></span> 0 <span class="heat"></span> <span></span>';
    scale.children[0].textContent = entry.name.replaceAll("_", " ");
    scale.children[1].style.background = `linear-gradient(90deg, ${[0, 0.25, 0.5, 0.75, 1].map((share) => `rgb(${di.looks.heat(share)})`)})`;
    scale.children[2].textContent = `${entry.peak.toExponential(1)} m, its component's G up to ${Number((100 * entry.share).toPrecision(2))} % of the largest`;
    return scale;
  }

  function responses() {
    by_id("responses").hidden = false;
    const marks = head.events.filter((event) => !event.apart).map((event) => ({ time_s: event.time_s, name: event.counts ? "bad" : "faint" }));
    if (head.what_if) marks.push({ time_s: head.what_if.at_s, name: "accent" });
    const made = di.rows.on(by_id("rows"), { head, looks, end_s: film.end_s, events: head.events, marks, on_time: (time_s) => transport.jump(time_s) });
    for (let layer = 0; layer < head.layers; layer++) by_id("layer").append(new Option(String(layer + 1), String(layer)));
    by_id("layer").value = String(head.layers - 1);
    by_id("layer").addEventListener("change", () => made.layer(Number(by_id("layer").value)));
    by_id("own-scale").addEventListener("change", () => made.own_scale(by_id("own-scale").checked));
    by_id("strip-mode").addEventListener("change", () => {
      made.mode(by_id("strip-mode").value);
      legend();
    });
    legend();
    return made;
  }

  function legend() {
    by_id("strip-legend").innerHTML = by_id("strip-mode").value === "gradient"
      ? '<b style="color: var(--gx)">▲ G<sub>x</sub></b> <b style="color: var(--gy)">▼ G<sub>y</sub></b>'
      : '<b style="color: var(--attention)">mean over heads</b>';
  }

  async function open_futures() {
    by_id("what-if").hidden = false;
    const numbers = head.what_if.answers.map((_, number) => number);
    const films = await Promise.all(numbers.map(async (number) => di.film.of(await read(`future-${number}`))));
    const each = await Promise.all(numbers.map((number) => read(`told-${number}`)));
    di.futures.on({ head, town, films, told: each.map((block) => block && di.told.of(head, block)) });
  }

  function tell(now, playing) {
    transport.tell(now, playing);
    const i = looks.place(now.time_s);
    rows?.tell(now.time_s);
    if (front) {
      const map = there.camera && shows("camera") ? camera_map : null;
      const waypoints = there.path && shows("path") ? looks.waypoints(i) : null;
      front.show(i, { map, waypoints, look: colours });
    }
    const peaks = maps.map((map) => `${map.entry.name.replaceAll("_", " ")} ${map.peak(i).toExponential(1)} m`);
    by_id("front-note").textContent = `looked at ${looks.time_s(i).toFixed(1)} s${peaks.length ? `; activation peaks: ${peaks.join(", ")}` : ""}`;
    if (told) tell_told(i);
    clearTimeout(naming);
    if (!playing && in_window) naming = setTimeout(() => history.replaceState(null, "", `#t=${now.time_s.toFixed(2)}`), 400);
  }

  function tell_told(i) {
    const facts = told.facts(i);
    rows?.dropped(facts.filter((fact) => !fact.given).map((fact) => fact.name));
    by_id("told-now").replaceChildren(
      ...facts.map(({ name, text, given }) => {
        const pair = document.createElement("div");
        pair.innerHTML = "<dt></dt><dd></dd>";
        pair.children[0].textContent = name.replaceAll("_", " ");
        pair.children[1].textContent = given ? text : "not given";
        pair.classList.toggle("dropped", !given);
        return pair;
      }),
    );
  }

  for (const name of Object.keys(there)) by_id(`show-${name}`).addEventListener("change", () => player.paint());
  addEventListener("hashchange", () => player.seek(Number(new URLSearchParams(location.hash.slice(1)).get("t")) || 0));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    colours = di.told.look(document.body);
    rows?.paint();
    player.paint();
  });
})((globalThis.driveinsight ??= {}));
