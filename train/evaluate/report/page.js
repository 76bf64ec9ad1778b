"use strict";
(async () => {
  const element = (id) => document.getElementById(id);
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];

  async function unpacked(id) {
    const bytes = Uint8Array.from(atob(element(id).textContent), (character) => character.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  }

  const report = JSON.parse(await unpacked("data"));
  const library = document.createElement("script");
  library.textContent = await unpacked("plotly");
  document.head.append(library);

  // ---- words ----------------------------------------------------------------------------------------------------

  const minus = (text) => text.replace("-", "−");
  const percent = (share) => minus((100 * share).toFixed(share > 0.99 && share < 1 ? 2 : share > -1 ? 1 : 0)) + "\u00a0%";
  const short = (share) => minus(String(Number((100 * share).toPrecision(6)))) + "\u00a0%";
  const rounded = (value) => minus(Math.abs(value) < 1000 ? value.toPrecision(3) : String(Number(value.toPrecision(3))));
  const signed = (value) => (value > 0 ? "+" : "") + minus(value.toFixed(2));

  function traits(t) {
    const degrees = Math.round((t.heading * 180) / Math.PI);
    const sea = t.hs === null ? "" : `Hs ${t.hs.toFixed(2)} m, Tp ${t.tp.toFixed(1)} s, waves towards ${degrees}° from the bow, `;
    return `${sea}${(t.load_mass / 1000).toFixed(0)} t on ${t.rope_length.toFixed(0)} m of rope ` +
      `(bobs at ${t.rope_period.toFixed(1)} s)`;
  }

  function wrapped(name, width) {
    const lines = [""];
    for (const word of name.split(" ")) {
      if (lines.at(-1) && lines.at(-1).length + word.length > width) lines.push("");
      lines[lines.length - 1] += (lines.at(-1) ? " " : "") + word;
    }
    return lines.map(escaped).join("<br>");
  }

  const escaped = (text) => text.replace(/[&<>]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;" })[c]);

  // ---- looks ----------------------------------------------------------------------------------------------------

  const COLOURS = 10;
  const DASHES = ["solid", "dot"];
  const narrow = () => window.innerWidth < 640;
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  // Agents that differ in their seed alone are one family, of one colour.
  const families = report.policies.flatMap(({ family }, policy) => (family === policy ? [policy] : []));
  const rank = (policy) => families.indexOf(report.policies[policy].family) - 1;
  const tint = (policy) => colour(rank(policy) < 0 ? "still" : `c${rank(policy) % COLOURS}`);
  const dash = (policy) =>
    report.policies[policy].privileged ? "dash" : DASHES[Math.floor(Math.max(0, rank(policy)) / COLOURS) % DASHES.length];
  const line = (policy, width = 2) => ({ color: tint(policy), width, dash: dash(policy) });

  function axis(title, extra = {}) {
    return {
      title: { text: title, standoff: 8 }, gridcolor: colour("rule"), linecolor: colour("rule"), zeroline: false,
      automargin: true, ...extra,
    };
  }

  function draw(figure, traces, layout) {
    const touch = window.matchMedia("(pointer: coarse)").matches;
    // Plotly reads names as HTML.
    const named = traces.map((trace) => ({ ...trace, ...(trace.name && { name: escaped(trace.name) }) }));
    Plotly.react(figure, named, {
      showlegend: false, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: { family: getComputedStyle(document.body).fontFamily, size: narrow() ? 11 : 12.5, color: colour("text") },
      hoverlabel: { bgcolor: colour("raised"), bordercolor: colour("rule"), font: { color: colour("text") }, namelength: -1 },
      margin: { l: 52, r: 14, t: 12, b: 44 },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("quiet"), activecolor: colour("text") },
      // A finger on a picture has to scroll the page.
      dragmode: touch ? false : "zoom",
      ...layout,
    }, { responsive: true, displaylogo: false, displayModeBar: touch ? false : "hover",
      modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] });
  }

  // Heave reduction on an axis that is logarithmic in what is left of the heave, turned so that better is further.
  const DECADES = Array.from({ length: 40 }, (_, index) => index - 20);
  const BEYOND = 1e9;
  const MOST_TICKS = 14;
  // Where profiles end, as a share of the heave that is left: a few lost loads would squeeze all the rest.
  const FARTHEST = 10;

  // Figures 1, 2, 5 of every decade from low to high; where there is little room or they are many, 1 alone.
  function ticksBetween(low, high, sparse) {
    const within = (digits) => DECADES.flatMap((decade) => digits.map((digit) => Number(`${digit}e${decade}`)))
      .filter((tick) => tick >= low && tick <= high);
    const fine = within([1, 2, 5]);
    return sparse || fine.length > MOST_TICKS ? within([1]) : fine;
  }

  function reductionAxis(title, values, sparse, extra = {}) {
    const seen = values.filter((value) => value > 0);
    const [low, high] = [Math.min(...seen, 0.5), Math.max(...seen, 1)];
    const ticks = ticksBetween(low / 1.15, high * 1.15, sparse);
    return axis(title, {
      type: "log", range: [Math.log10(high * 1.15), Math.log10(low / 1.15)],
      tickmode: "array", tickvals: ticks, ticktext: ticks.map((left) => short(1 - left)), ...extra,
    });
  }

  // A logarithmic axis from low to high.
  function logAxis(title, low, high, sparse, extra = {}) {
    const shown = ticksBetween(low, high, sparse);
    return axis(title, {
      type: "log", range: [Math.log10(low), Math.log10(high)], tickmode: "array", tickvals: shown,
      ticktext: shown.map((tick) => (tick >= 0.01 && tick < 1e4 ? String(tick) : `10<sup>${minus(String(Math.round(Math.log10(tick))))}</sup>`)),
      ...extra,
    });
  }

  // ---- policies to tick and to open -----------------------------------------------------------------------------

  const several = (policy) => report.policies[policy].seeds.length > 1;
  const opened = new Set();
  // Policies as they stand in table and pictures: a family as one, or where it is opened its seeds.
  const shownOf = (policies) => policies.flatMap((policy) => (opened.has(policy) ? report.policies[policy].seeds : [policy]));

  // One choice for all pictures: families that checkboxes tick, and their line in the bar.
  function chips(chosen, redraw) {
    const holder = element("policies").querySelector(".chips");
    const tick = (box) => { if (box.checked) chosen.add(Number(box.dataset.policy)); else chosen.delete(Number(box.dataset.policy)); };
    const boxes = families.map((policy) => {
      const label = document.createElement("label");
      label.className = "chip";
      const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: chosen.has(policy) });
      box.dataset.policy = policy;
      label.append(box, sample(policy), report.policies[policy].name);
      if (report.policies[policy].privileged) label.title = "knows the whole future";
      box.addEventListener("change", () => { tick(box); redraw(); });
      holder.append(label);
      return box;
    });
    for (const [word, wanted] of [["all", true], ["none", false]]) {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: word });
      button.addEventListener("click", () => {
        for (const box of boxes) { box.checked = wanted; tick(box); }
        redraw();
      });
      holder.append(button);
    }
  }

  function sample(policy) {
    const line = Object.assign(document.createElement("i"), { className: "line" });
    line.dataset.policy = policy;
    return line;
  }

  // Names of policies behind samples of their lines, each with a word where there is one.
  function legend(holder, policies, word = () => "") {
    holder.replaceChildren(...policies.map((policy) => {
      const item = document.createElement("span");
      item.append(sample(policy), report.policies[policy].name);
      if (word(policy)) item.append(Object.assign(document.createElement("small"), { textContent: word(policy) }));
      return item;
    }));
    colourSamples(holder);
  }

  function colourSamples(within = document) {
    for (const line of all(".line[data-policy]", within)) {
      const policy = Number(line.dataset.policy);
      line.style.borderTop = `3px ${{ solid: "solid", dash: "dashed", dot: "dotted" }[dash(policy)]} ${tint(policy)}`;
    }
  }

  function bar() {
    legend(element("shown"), inOrder(drawn));
    if (!drawn.size) element("shown").textContent = "none";
  }

  const inOrder = (chosen) => [...chosen].sort((a, b) => a - b);
  const marked = (policy) => report.policies[policy].name + (report.policies[policy].privileged ? " (privileged)" : "");

  function fill(select, options, value) {
    select.replaceChildren(...options.map(([key, text]) => new Option(text, key)));
    select.value = value;
  }

  // ---- sections -------------------------------------------------------------------------------------------------

  let subset = 0;

  function table() {
    for (const body of all("#table tbody")) body.hidden = Number(body.dataset.subset) !== subset;
    for (const row of all("#table tr[data-family]")) row.hidden = !opened.has(Number(row.dataset.family));
    for (const button of all("#table .open")) button.setAttribute("aria-expanded", opened.has(Number(button.dataset.policy)));
    for (const select of all("select.subset")) select.value = subset;
  }

  function profiles(section, policies) {
    const curves = policies.map((policy) => [policy, report.subsets[subset].profiles[policy]]);
    draw(section.querySelector(".plot"), curves.map(([policy, { x, y }]) => ({
      // From nobody at its best, through the steps, to everybody out to the edge.
      x: [x[0], ...x, BEYOND], y: [0, ...y, 1], name: marked(policy), mode: "lines", line: { ...line(policy, 2.2), shape: "hv" },
      text: [x[0], ...x, x.at(-1)].map((left) => percent(1 - left)),
      hovertemplate: "%{fullData.name}: at least %{text} in %{y:.1%}<extra></extra>",
    })), {
      xaxis: reductionAxis("heave reduction", curves.flatMap(([, { x }]) => x.filter((left) => left <= FARTHEST)), narrow()),
      yaxis: axis("share of scenarios", {
        range: [0, 1.02], tickvals: [0, 0.2, 0.4, 0.6, 0.8, 1], ticktext: [0, 0.2, 0.4, 0.6, 0.8, 1].map(short),
      }),
    });
  }

  function pairs(section) {
    const reference = Number(element("reference").value);
    const found = shownOf(families).map((policy) => [policy, report.pairs[reference][policy]]).filter(([, pair]) => pair);
    // Privileged policies stand apart, below all others.
    const apart = ([policy]) => (report.policies[policy].privileged ? 1 : 0);
    found.sort((a, b) => apart(a) - apart(b) || a[1].ratio.value - b[1].ratio.value);
    const ends = found.flatMap(([, pair]) => [...pair.spread, pair.ratio.low, pair.ratio.high]);
    const places = found.map((_, place) => found.length - 1 - place);
    const traces = found.flatMap(([policy, pair], index) => [
      { x: pair.spread, y: [places[index], places[index]], mode: "lines", line: { color: tint(policy), width: 1.5 }, hoverinfo: "skip" },
      { x: [pair.ratio.low, pair.ratio.high], y: [places[index], places[index]], mode: "lines", line: { color: tint(policy), width: 10 }, opacity: 0.5, hoverinfo: "skip" },
      {
        x: [pair.ratio.value], y: [places[index]], mode: "markers", name: marked(policy),
        marker: { color: report.policies[policy].privileged ? colour("ground") : tint(policy), size: 8, line: { color: tint(policy), width: 2 } },
        hovertemplate: `%{fullData.name}: %{x:.3g} times the RMS error<br>better in ${percent(pair.better)}<extra></extra>`,
      },
    ]);
    section.querySelector(".plot").style.height = `${Math.max(10, 5 + found.length * (narrow() ? 2.9 : 2.1))}rem`;
    draw(section.querySelector(".plot"), traces, {
      xaxis: logAxis("RMS error over the reference's", Math.min(0.5, ...ends) / 1.3, Math.max(2, ...ends) * 1.3, narrow()),
      yaxis: axis("", {
        tickmode: "array", tickvals: places, range: [-0.6, found.length - 0.4], showgrid: false,
        ticktext: found.map(([policy]) => wrapped(marked(policy), narrow() ? 16 : 40)),
      }),
      shapes: [{ type: "line", x0: 1, x1: 1, y0: 0, y1: 1, yref: "paper", line: { color: colour("quiet"), width: 1.5, dash: "dot" } }],
    });
    element("pair-table").tBodies[0].replaceChildren(...found.map(([policy, pair]) => {
      const row = document.createElement("tr");
      if (report.policies[policy].privileged) row.className = "privileged";
      const name = document.createElement("th");
      name.scope = "row";
      name.append(report.policies[policy].name);
      if (report.policies[policy].privileged) {
        name.append(" ", Object.assign(document.createElement("span"), { className: "tag", textContent: "privileged" }));
      }
      const d = pair.difference, r = pair.ratio;
      const cells = [
        [pair.scenarios],
        [signed(100 * d.value), `${signed(100 * d.low)} … ${signed(100 * d.high)}`],
        [rounded(r.value), `${rounded(r.low)} … ${rounded(r.high)}`],
        [percent(pair.better)],
      ].map(([main, small]) => {
        const cell = document.createElement("td");
        cell.append(main);
        if (small) cell.append(Object.assign(document.createElement("small"), { textContent: small }));
        return cell;
      });
      row.append(name, ...cells);
      return row;
    }));
  }

  function dependence(section, policies) {
    const every = policies.flatMap((policy) => report.clouds[policy].left);
    all(".plot", section).forEach((figure, place) => {
      const { label, x, median } = report.dependences[place];
      draw(figure, policies.flatMap((policy) => {
        const { scenarios, left } = report.clouds[policy];
        return [
          {
            x: scenarios.map((scenario) => x[scenario]), y: left, mode: "markers", name: marked(policy),
            marker: { color: tint(policy), size: 4, opacity: 0.45, symbol: report.policies[policy].privileged ? "circle-open" : "circle" },
            text: left.map((value, index) => `scenario ${scenarios[index]}: ${percent(1 - value)}`),
            hovertemplate: "%{fullData.name}, %{text}<extra></extra>",
          },
          { ...median[policy], mode: "lines", name: marked(policy), line: line(policy, 2.6), hoverinfo: "skip" },
        ];
      }), {
        xaxis: axis(escaped(label)),
        yaxis: reductionAxis(place % 2 && !narrow() ? "" : "heave reduction", every, true),
      });
    });
  }

  function histories(section, policies) {
    const example = report.examples[Number(element("scenario").value)];
    const ran = new Map(example.histories.map((history) => [history.policy, history]));
    // A family as its first seed.
    const shown = policies.flatMap((policy) => ran.get(report.policies[policy].seeds[0]) ?? []);
    const left = policies.filter((policy) => !ran.has(report.policies[policy].seeds[0]));
    legend(section.querySelector(".legend"), [...shown.map((history) => history.policy), ...left],
      (policy) => (ran.has(policy) ? percent(ran.get(policy).reduction) : "did not run"));
    element("scenario-traits").textContent = `Scenario ${example.scenario}: ${traits(example.traits)}.`;
    const best = ran.has(report.policies[report.reference].seeds[0]) ? report.reference : 0;
    element("scenario-replay").replaceChildren(...replay(best, example.scenario));
    const rows = [
      ["error", "depth error, m", "y", 1],
      ["error", "the same, cm", "y2", 100],
      ["rope_speed", "rope paid out, m/s", "y3", 1],
      ["tension", "rope tension, kN", "y4", 1],
    ];
    const traces = rows.flatMap(([quantity, , yaxis, factor]) => shown.map((history) => ({
      x: history[quantity].map((_, step) => Number((step * report.control_period).toFixed(6))),
      y: history[quantity].map((value) => factor * value),
      yaxis, name: marked(history.policy), mode: "lines", line: line(history.policy, 1.6),
      hovertemplate: "%{fullData.name}: %{y:.3g}<extra></extra>",
    })));
    const small = magnified(example, shown);
    const layout = {
      xaxis: axis("time, s", { anchor: "y4", domain: [0, 1] }), hovermode: "closest", margin: { l: 56, r: 14, t: 8, b: 44 },
    };
    rows.forEach(([, title, name], index) => {
      const top = 1 - index * 0.26;
      layout[name.replace("y", "yaxis")] = axis(title, {
        domain: [Math.max(0, top - 0.22), top], automargin: false, ...(name === "y2" ? { range: [-small, small] } : {}),
      });
    });
    draw(section.querySelector(".plot"), traces, layout);
  }

  // The scale, cm, at which what the better half of the policies leaves can be seen.
  function magnified(example, shown) {
    const sorted = [...(shown.length ? shown : example.histories)].sort((a, b) => b.reduction - a.reduction);
    const middle = sorted[Math.floor((sorted.length - 1) / 2)];
    return 115 * Math.max(...middle.error.map(Math.abs), 1e-5);
  }

  function spectra(section, policies) {
    const curves = report.subsets[subset].spectra;
    const [lowest, highest] = [curves[0].x[0], curves[0].x.at(-1)];
    const top = Math.max(...(policies.length ? policies : families).flatMap((policy) => curves[policy].y));
    draw(section.querySelector(".plot"), policies.map((policy) => ({
      ...report.subsets[subset].spectra[policy], name: marked(policy), mode: "lines", line: line(policy),
      text: report.subsets[subset].spectra[policy].x.map((frequency) => `${rounded(frequency)} Hz (${rounded(1 / frequency)} s)`),
      hovertemplate: "%{fullData.name} at %{text}: %{y:.2e} m²/Hz<extra></extra>",
    })), {
      xaxis: logAxis("frequency, Hz", lowest, highest, narrow()),
      yaxis: logAxis("spectral density, m²/Hz", top * 1e-11, top * 2, true),
    });
  }

  // How to watch a policy's episode: a command, where there is one.
  function replay(policy, scenario) {
    const command = report.policies[policy].replay;
    if (!command) return [];
    const paragraph = Object.assign(document.createElement("p"), { className: "note" });
    const code = document.createElement("code");
    code.textContent = `${command} ${scenario}`;
    paragraph.append(`Watch ${marked(policy)} in it: `, code);
    return [paragraph];
  }

  function worst() {
    const policy = Number(element("worst-policy").value);
    const holder = element("episodes");
    for (const figure of all(".plot", holder)) Plotly.purge(figure);
    holder.replaceChildren(...report.worst[policy].map((episode, rank) => {
      const article = Object.assign(document.createElement("article"), { className: "episode" });
      const title = document.createElement("h3");
      title.textContent = `${rank + 1}. Scenario ${episode.scenario}: heave reduction ${percent(episode.reduction)}`;
      const facts = document.createElement("p");
      facts.textContent = `${traits(episode.traits)}. RMS ${rounded(100 * episode.rms)} cm, ` +
        `${rounded(100 * episode.still_rms)} cm with the drum still; largest error ${rounded(100 * episode.omega2)} cm.`;
      const list = document.createElement("ul");
      list.append(...episode.what.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
      const words = document.createElement("div"), body = document.createElement("div");
      words.append(facts, list, ...replay(policy, episode.scenario));
      const figure = Object.assign(document.createElement("figure"), { className: "plot" });
      figure.setAttribute("aria-label", `Depth error in scenario ${episode.scenario}`);
      body.append(words, figure);
      article.append(title, body);
      return article;
    }));
    all(".plot", holder).forEach((figure, rank) => {
      const { error, still_error } = report.worst[policy][rank];
      const trace = (values, who, width) => ({
        x: values.map((_, step) => Number((step * report.control_period).toFixed(6))), y: values,
        name: marked(who), mode: "lines", line: line(who, width), hovertemplate: "%{fullData.name}: %{y:.3g} m<extra></extra>",
      });
      draw(figure, [trace(still_error, 0, 1.2), trace(error, policy, 1.8)], {
        xaxis: axis("time, s"), yaxis: axis("depth error, m"), margin: { l: 50, r: 10, t: 6, b: 40 },
      });
    });
  }

  // ---- bring it to life -----------------------------------------------------------------------------------------

  const sections = Object.fromEntries(all("main section").map((section) => [section.id, section]));
  const drawn = new Set([0, ...report.featured]);
  const pictured = () => shownOf(inOrder(drawn));
  const redraw = {
    table, bar, profiles: () => profiles(sections.profiles, pictured()), pairs: () => pairs(sections.pairs),
    dependence: () => dependence(sections.dependence, pictured()),
    histories: () => histories(sections.histories, pictured()),
    spectra: () => spectra(sections.spectra, pictured()), worst,
  };
  const again = (...names) => { for (const name of names) redraw[name](); };
  chips(drawn, () => again("bar", "profiles", "dependence", "histories", "spectra"));
  for (const button of all("#table .open")) {
    const policy = Number(button.dataset.policy);
    button.addEventListener("click", () => {
      if (opened.has(policy)) opened.delete(policy); else opened.add(policy);
      again("table", "profiles", "pairs", "dependence", "histories", "spectra");
    });
  }

  const named = (policies) => policies.map((policy) => [policy, marked(policy)]);
  const single = report.policies.flatMap((_, policy) => (several(policy) ? [] : [policy]));
  fill(element("reference"), named(families), report.reference);
  fill(element("worst-policy"), named(single.filter((policy) => report.worst[policy].length)),
    report.policies[report.reference || 1].seeds[0]);
  fill(element("scenario"), report.examples.map(({ scenario, label, traits: t }, index) => [
    index, `${label}: scenario ${scenario}` + (t.hs === null ? "" : `, Hs ${t.hs.toFixed(1)} m, Tp ${t.tp.toFixed(1)} s`),
  ]), 0);
  element("reference").addEventListener("change", redraw.pairs);
  element("scenario").addEventListener("change", redraw.histories);
  element("worst-policy").addEventListener("change", redraw.worst);
  for (const select of all("select.subset")) {
    select.addEventListener("change", () => {
      subset = Number(select.value);
      again("table", "profiles", "spectra");
    });
  }

  function everything() {
    colourSamples();
    again(...Object.keys(redraw));
  }

  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  function theme(name) {
    document.documentElement.dataset.theme = name;
    everything();
  }
  element("theme").addEventListener("click", () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
  dark.addEventListener("change", () => theme(dark.matches ? "dark" : "light"));

  theme(dark.matches ? "dark" : "light");
  document.documentElement.dataset.ready = "yes";
})().catch((error) => {
  const notice = document.getElementById("failure");
  notice.hidden = false;
  notice.textContent = `The pictures could not be drawn: ${error.message}`;
  console.error(error);
});
