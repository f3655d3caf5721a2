"use strict";
// Plays, scrubs and steps a player, and tells of the moment: buttons, the bar with its ticks, the
// ego's numbers, the list of events, keys.
//
// const transport = di.transport.of(player)
// transport.show(events, end_s), transport.tell(now, playing), transport.jump(time_s)

(function (di) {
  const by_id = (id) => document.getElementById(id);

  function of(player) {
    let events = [];
    let end_s = 0;

    function jump(time_s) {
      player.step(time_s - player.time_s);
    }

    function jump_to_event(direction) {
      const times = events.map((event) => event.time_s);
      const later = direction > 0 ? times.filter((time) => time > player.time_s + 0.01) : times.filter((time) => time < player.time_s - 0.01);
      if (later.length) jump(direction > 0 ? Math.min(...later) : Math.max(...later));
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

    function turn() {
      by_id("turn").setAttribute("aria-pressed", String(player.turn()));
    }

    by_id("play").addEventListener("click", () => player.toggle());
    by_id("scrub").addEventListener("input", () => jump(Number(by_id("scrub").value)));
    by_id("zoom-in").addEventListener("click", () => player.zoom(1.4));
    by_id("zoom-out").addEventListener("click", () => player.zoom(1 / 1.4));
    by_id("turn").addEventListener("click", turn);
    by_id("follow").addEventListener("click", () => player.follow());
    by_id("turn").setAttribute("aria-pressed", String(player.turns));
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
      h: turn,
      "+": () => player.zoom(1.4),
      "-": () => player.zoom(1 / 1.4),
    };

    addEventListener("keydown", (event) => {
      const { tagName: name, type } = event.target;
      const own = ["SELECT", "BUTTON", "A", "SUMMARY"].includes(name) || (name === "INPUT" && type !== "range");
      if (event.ctrlKey || event.altKey || event.metaKey || (own && event.key === " ")) return;
      if (type === "range" && event.target.id !== "scrub") return; // another bar's own keys
      if (name === "SELECT" || !(event.key in KEYS) || end_s === 0) return;
      event.preventDefault();
      KEYS[event.key](event);
    });

    return {
      jump,
      show(other, until_s) {
        [events, end_s] = [other.filter((event) => !event.apart), until_s];
        const apart = other.filter((event) => event.apart);
        by_id("apart").hidden = apart.length === 0;
        by_id("apart").firstElementChild.textContent = `Of no account under these rules, such as the pace: ${apart.length}`;
        by_id("apart-list").replaceChildren(...apart.map(line));
        by_id("scrub").max = end_s;
        by_id("ticks").replaceChildren(...events.map((event) => tick(event, end_s)));
        by_id("event-list").replaceChildren(...events.map(line));
      },
      tell(now, playing) {
        tell_now(now);
        by_id("scrub").value = now.time_s;
        by_id("scrub").setAttribute("aria-valuetext", `${now.time_s.toFixed(1)} seconds`);
        by_id("clock").textContent = `${clock(now.time_s)} / ${clock(end_s)}`;
        by_id("play").textContent = playing ? "⏸" : "▶";
        by_id("play").setAttribute("aria-label", playing ? "Pause" : "Play");
        tell_events(now.time_s);
      },
    };
  }

  function tell_now(now) {
    by_id("now-time").textContent = `${now.time_s.toFixed(1)} s`;
    by_id("now-speed").textContent = di.film.kmh(now.ego.speed);
    by_id("now-done").textContent = `${now.completion.toFixed(1)} %`;
    by_id("now-score").textContent = now.score.toFixed(1);
    bar("throttle", now.throttle, false);
    bar("brake", now.brake, false);
    bar("steer", now.steer, true);
  }

  function bar(name, value, both_ways) {
    const fill = by_id(`bar-${name}`);
    fill.style.left = both_ways ? `${50 + Math.min(50 * value, 0)}%` : "0";
    fill.style.width = `${Math.abs(value) * (both_ways ? 50 : 100)}%`;
    by_id(`value-${name}`).textContent = value.toFixed(2);
  }

  function tick(event, end_s) {
    const mark = document.createElement("i");
    mark.className = `kind-${event.kind}${event.counts ? "" : " minor"}`;
    mark.style.left = `${(100 * event.time_s) / end_s}%`;
    return mark;
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

  function clock(time_s) {
    const minutes = Math.floor(time_s / 60);
    return `${minutes}:${(time_s - 60 * minutes).toFixed(1).padStart(4, "0")}`;
  }

  di.transport = { of, clock };
})((globalThis.driveinsight ??= {}));
