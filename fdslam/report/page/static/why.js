// The page of one query, by #query-N: what each method sees, which OBBs disagree with the strong list, and that list.

const report = document.getElementById("main");
const page = document.getElementById("why");
const byId = new Map(data.queries.map((query) => [query.id, query]));
const title = document.title;
let current = null; // the query that is shown
let entered = false; // from the gallery: then going back is one step in the history

const shownNumber = (value) => String(Math.round(value * 10) / 10);

function grid(caption, heads, lines) {
  const head = make("tr", {}, ...heads.map((text) => make("th", {scope: "col"}, text)));
  const rows = lines.map((line) => make("tr", {}, ...line.map((cell, i) => make(i ? "td" : "th", i ? {} : {scope: "row"}, cell))));
  const table = make("table", {}, make("caption", {}, make("span", {}, caption)), make("thead", {}, head), make("tbody", {}, ...rows));
  return make("div", {class: "scroll", tabindex: 0, role: "region", "aria-label": caption}, table);
}

function picture(query) {
  const box = scene(query);
  const lines = box.querySelector(".lines");
  const [width, height] = query.size;
  const size = Math.max(width, height) / 28;
  query.why.forEach(({box: [x0, y0, x1, y1]}, i) => {
    const outside = x1 - x0 < 3 * size; // the number would hide what is in the box
    let [right, low] = [[0, 0], [1, 0], [1, 1], [0, 1]][i % 4]; // boxes often share a corner
    if (outside && (right ? x1 + size > width : x0 < size)) right = 1 - right;
    const part = draw("g", {class: "witness", "data-number": i + 1});
    part.append(draw("path", {d: outline([x0, y0, x1, y1])}));
    const towards = (right ? 1 : -1) * (outside ? 1 : -1);
    const at = {x: (right ? x1 : x0) + (towards * size) / 4, y: low ? y1 - size / 4 : y0 + size};
    const text = draw("text", {...at, "font-size": size, "text-anchor": towards > 0 ? "start" : "end"});
    text.textContent = i + 1;
    part.append(text);
    lines.append(part);
  });
  box.dataset.told = query.why.length ? `the ${query.why.length} OBBs that disagree most, numbered` : "";
  return box;
}

function pointer(box, number) {
  const button = make("button", {type: "button", "aria-pressed": "false", title: "Show this OBB alone"}, String(number));
  button.addEventListener("click", () => {
    const on = button.getAttribute("aria-pressed") === "false";
    page.querySelectorAll("button[aria-pressed]").forEach((each) => each.setAttribute("aria-pressed", "false"));
    button.setAttribute("aria-pressed", String(on));
    box.querySelectorAll(".witness").forEach((each) => {
      each.style.display = on && each.dataset.number !== String(number) ? "none" : "";
    });
  });
  return button;
}

function witnesses(query, box) {
  const places = query.hypotheses.map((_, y) => `m${y + 1}`);
  const heads = ["OBB", "source", "x, y, width, height", "disagreement", ...places, "first in its own list"];
  const lines = query.why.map((one, i) => {
    const [x0, y0, x1, y1] = one.box.map(Math.round);
    const first = one.silent ? "nothing: all images rank alike" : one.first + (one.ties ? ` and ${one.ties} more` : "");
    const where = `${x0}, ${y0}, ${x1 - x0}, ${y1 - y0}`;
    return [pointer(box, i + 1), one.source, where, shownNumber(one.disagreement), ...one.ranks.map(String), first];
  });
  return grid(`OBBs by the ${data.pooling} of the ranks that their own (weak) lists give to the strong list's m1, m2, … of ${data.map} map images`, heads, lines);
}

function strongList(query) {
  const items = query.hypotheses.map((one, y) => {
    const sum = data.predicted ? `, relevance ${one.relevance}` : "";
    return make("li", {class: one.right === false ? "wrong" : one.right ? "right" : ""}, memory(query, y),
      make("p", {}, make("b", {}, `m${y + 1} `), `${one.name}${placeInWords(query, y)}${sum}`));
  });
  return make("ol", {class: "strong"}, ...items);
}

function heats(query) {
  const figures = data.methods.map((method, i) => {
    const box = make("div", {class: "scene heated"}, make("img", {class: "photo", alt: "", src: data.images[query.image]}));
    box.style.aspectRatio = `${query.size[0]} / ${query.size[1]}`;
    const truth = draw("svg", {viewBox: `0 0 ${query.size[0]} ${query.size[1]}`, class: "lines", "aria-hidden": "true"});
    truth.append(draw("path", {class: "truth found", d: (query.truth ?? []).map((one) => outline(one.box)).join("")}));
    box.append(cells(query, query.heat[i], "heat", `Likelihood of change by ${method}`), truth);
    const score = query.score ? `, score ${query.score[i].toFixed(2)}` : "";
    const caption = `${method}: its highest 1 % of the cells above ${Math.min(99.9, 100 * query.highest[i]).toFixed(1)} % of all${score}`;
    return make("figure", {}, box, make("figcaption", {}, caption));
  });
  const among = make("select", {name: "among"}, make("option", {value: "heat"}, "the cells of all queries"), make("option", {value: "within"}, "the cells of this query"));
  among.addEventListener("change", () => figures.forEach((figure, i) => {
    figure.querySelector(".heat").src = query[among.value][i];
  }));
  return [make("p", {}, make("label", {}, "Brightness is the place among ", among)), make("div", {class: "heats"}, ...figures)];
}

function neighbour(step) {
  const there = shown.includes(current) ? shown : data.queries;
  return there[there.indexOf(current) + step];
}

function step(label, query) {
  return query ? make("a", {href: `#query-${query.id}`, class: "step"}, label) : make("span", {class: "step"}, label);
}

function build(query) {
  const box = picture(query);
  const sum = Object.entries(query.obbs).map(([source, {count: n}]) => `${source} ${n}`).join(", ");
  const silent = query.silent ? `; ${query.silent} more hold too few keypoints to say anything` : "";
  const said = make("p");
  const again = () => {
    refresh(box, query);
    said.textContent = [query.pair, inWords(query)].filter(Boolean).join(": ");
    const form = document.getElementById("controls").elements; // there it is the same choice
    form.method.value = state.method;
    form.heat.checked = state.heat;
  };
  const method = choice("method", "method", numbered(data.methods), state.method, (i) => { state.method = Number(i); again(); });
  const heat = tick("heat", "heat map", state.heat, (on) => { state.heat = on; again(); });
  again();
  const parts = [
    make("p", {class: "steps"}, make("a", {href: "#gallery", class: "back"}, "Back to the queries (Esc)"), " ",
      step("← previous", neighbour(-1)), " ", step("next →", neighbour(1))),
    make("h1", {}, query.name),
    said,
    make("p", {class: "steps"}, method, heat),
    make("div", {class: "large"}, box),
    make("p", {class: "note"}, `OBBs: ${sum || "none"}${silent}.`),
  ];
  if (query.lost) parts.push(make("p", {class: "warning"}, "Localisation is lost: no weak list tells one map image from another."));
  parts.push(make("h2", {}, "Why: the OBBs that disagree most"));
  parts.push(query.why.length ? witnesses(query, box) : make("p", {}, "No OBB says anything here, or there is no hypothesis to disagree with."));
  parts.push(make("h2", {}, data.predicted ? `The strong list, its first ${query.hypotheses.length}` : "The true places, which stand for the strong list"));
  parts.push(query.hypotheses.length ? strongList(query) : make("p", {}, "The map has no such place."));
  parts.push(make("h2", {}, "What each method sees"), ...heats(query));
  return parts;
}

function route() {
  const wanted = /^#query-(\d+)$/.exec(location.hash);
  const left = current;
  current = wanted ? byId.get(Number(wanted[1])) ?? null : null;
  report.hidden = Boolean(wanted);
  page.hidden = !wanted;
  document.title = current ? `${current.name} – ${title}` : title;
  if (wanted) {
    const missing = [make("p", {role: "alert"}, "This query is not in the page."), make("a", {href: "#gallery"}, "Back to the queries")];
    page.replaceChildren(...(current ? build(current) : missing));
    page.style.setProperty("--heat", state.opacity);
    if (current) page.style.setProperty("--aspect", current.size[0] / current.size[1]);
    scrollTo(0, 0);
    page.focus({preventScroll: true});
    return;
  }
  page.replaceChildren();
  entered = false;
  if (left && ["", "#gallery"].includes(location.hash)) {
    const link = cards.get(left).querySelector("a");
    (link.isConnected ? link : document.getElementById("gallery")).focus();
  } else if (location.hash) {
    document.getElementById(location.hash.slice(1))?.scrollIntoView();
  }
}

function leave() {
  if (entered) history.back();
  else location.hash = "gallery";
}

document.addEventListener("click", (event) => {
  const link = event.target.closest("a");
  if (!link) return;
  if (link.className === "skip") {
    event.preventDefault();
    (current ? page : report).focus();
  } else if (link.classList.contains("step")) {
    event.preventDefault();
    location.replace(link.hash); // so that going back leads to the gallery
  } else if (link.classList.contains("back")) {
    event.preventDefault();
    leave();
  } else if (link.hash.startsWith("#query-")) {
    entered = true;
  }
});

document.addEventListener("keydown", (event) => {
  if (!current || event.altKey || event.ctrlKey || event.metaKey) return;
  if (event.key === "Escape") leave();
  if (event.target.closest("input, select, .scroll")) return; // there arrows have another meaning
  const next = {ArrowLeft: neighbour(-1), ArrowRight: neighbour(1)}[event.key];
  if (next) location.replace(`#query-${next.id}`);
});

addEventListener("hashchange", route);
route();
