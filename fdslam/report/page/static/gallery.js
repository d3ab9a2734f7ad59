// The queries as cards, and what is shown of them: switches, order and filters.

const cards = new Map(); // query -> its card; filled when it comes near the window
const boxed = data.queries.some((query) => query.boxes);
const order = {sort: data.annotated ? "worst" : boxed ? "highest" : "path", pair: "", outcome: ""};
const list = document.getElementById("cards");
let shown = data.queries;

const byText = (a, b) => a.name.localeCompare(b.name, undefined, {numeric: true});
const SORTS = {
  worst: ["worst first", (a, b) => a.score[state.method] - b.score[state.method]],
  best: ["best first", (a, b) => b.score[state.method] - a.score[state.method]],
  highest: ["most change seen first", (a, b) => b.highest[state.method] - a.highest[state.method]],
  path: ["order of the path", (a, b) => a.id - b.id],
  name: ["name", byText],
};

function card(query) {
  const link = make("a", {href: `#query-${query.id}`}, query.name);
  const made = make("li", {class: "card"}, make("h3", {}, link), make("div", {class: "views"}), make("p", {class: "said"}));
  made.style.setProperty("--aspect", query.size[0] / query.size[1]);
  return made;
}

function fill(query) {
  const made = cards.get(query);
  const views = made.querySelector(".views");
  if (views.childElementCount) return;
  views.append(scene(query));
  if (query.hypotheses.length) {
    const top = make("figure", {class: "top"}, memory(query, 0));
    top.append(make("figcaption", {}, query.hypotheses[0].name + placeInWords(query, 0)));
    top.hidden = !state.map;
    views.append(top);
  }
  made.querySelector(".said").textContent = inWords(query);
}

const near = new IntersectionObserver(
  (entries) => entries.forEach((entry) => {
    if (!entry.isIntersecting) return;
    near.unobserve(entry.target);
    fill(entry.target.query);
  }),
  {rootMargin: "600px"},
);

function redraw() {
  list.style.setProperty("--heat", state.opacity);
  list.classList.toggle("alone", !state.map);
  for (const [query, made] of cards) {
    const box = made.querySelector(".scene");
    if (!box) continue;
    refresh(box, query);
    made.querySelector(".said").textContent = inWords(query);
    const top = made.querySelector(".top");
    if (top) top.hidden = !state.map;
  }
}

function arrange() {
  const fits = (query) => (!order.pair || query.pair === order.pair) && (!order.outcome || outcome(query) === order.outcome);
  const compare = SORTS[order.sort][1];
  shown = data.queries.filter(fits).sort((a, b) => compare(a, b) || a.id - b.id);
  list.replaceChildren(...shown.map((query) => cards.get(query)));
  document.getElementById("count").textContent = `${shown.length} of ${count(data.queries.length, "query", "queries")} shown`;
}

const numbered = (names) => names.map((name, i) => [String(i), name]);

function choice(name, label, options, chosen, act) {
  const select = make("select", {name}, ...options.map(([value, text]) => make("option", {value}, text)));
  select.value = chosen;
  select.addEventListener("change", () => { act(select.value); redraw(); arrange(); });
  return make("label", {}, `${label} `, select);
}

function tick(name, label, chosen, act) {
  const box = make("input", {type: "checkbox", name, checked: chosen});
  box.addEventListener("change", () => { act(box.checked); redraw(); });
  return make("label", {}, box, ` ${label}`);
}

function slider() {
  const range = make("input", {type: "range", name: "opacity", min: 0, max: 1, step: 0.05, value: state.opacity});
  range.addEventListener("input", () => { state.opacity = range.value; redraw(); });
  return make("label", {}, "opacity ", range);
}

function sourceTick(source, i) {
  const act = (on) => { if (on) state.sources.add(source); else state.sources.delete(source); };
  const label = tick(`obb-${source}`, source, state.sources.has(source), act);
  label.append(make("span", {class: `swatch source-${i % 6}`, "aria-hidden": "true"}));
  return label;
}

function group(legend, ...parts) {
  return make("fieldset", {}, make("legend", {}, legend), ...parts);
}

function controls() {
  const sorts = Object.entries(SORTS).filter(([key]) => data.annotated || !["worst", "best"].includes(key));
  const pairs = [...new Set(data.queries.map((query) => query.pair))].filter(Boolean);
  const over = group(
    "Likelihood of change (LoC)",
    choice("method", "method", numbered(data.methods), state.method, (value) => { state.method = Number(value); }),
    tick("heat", "heat map", state.heat, (on) => { state.heat = on; }),
    slider(),
    make("span", {class: "bar"}, "low ", make("span", {class: "colours", "aria-hidden": "true"}), " high, by place among all cells"),
  );
  const boxes = group("Outlines of OBBs", ...sources.map(sourceTick));
  const more = group("Also", tick("map", "top map image", state.map, (on) => { state.map = on; }));
  if (boxed) more.append(tick("boxes", "candidate boxes of change", state.boxes, (on) => { state.boxes = on; }));
  if (data.annotated) more.append(tick("truth", "true changes (dashed: missed)", state.truth, (on) => { state.truth = on; }));
  if (data.queries.some((query) => query.mask)) more.append(tick("mask", "mask", state.mask, (on) => { state.mask = on; }));
  const sorting = group(
    "Order and filter",
    choice("sort", "order", sorts.map(([key, [label]]) => [key, label]), order.sort, (value) => { order.sort = value; }),
  );
  if (pairs.length > 1) {
    const options = [["", "all pairs"], ...pairs.map((pair) => [pair, pair])];
    sorting.append(choice("pair", "sessions", options, "", (value) => { order.pair = value; }));
  }
  if (data.annotated) {
    const outcomes = [["", "all"], ["found", "all objects found"], ["missed", "an object missed"], ["unchanged", "unchanged"]];
    sorting.append(choice("outcome", "show", outcomes, "", (value) => { order.outcome = value; }));
    const percents = numbered(data.percents.map((x) => `${x} %`));
    sorting.append(choice("percent", "found at X =", percents, state.percent, (value) => { state.percent = Number(value); }));
  }
  const form = document.getElementById("controls");
  form.append(over, boxes, more, sorting);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.hidden = false;
}

if (data.queries.length) {
  for (const query of data.queries) {
    const made = card(query);
    made.query = query;
    cards.set(query, made);
    near.observe(made);
  }
  controls();
  redraw();
  arrange();
}
