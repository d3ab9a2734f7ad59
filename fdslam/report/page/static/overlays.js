// A query with what lies over it: the LoC of a method, the mask, the OBBs of each source, and the true changes.

const data = JSON.parse(document.getElementById("data").textContent);
const sources = [...new Set(data.queries.flatMap((query) => Object.keys(query.obbs)))].sort();
const state = {
  method: data.methods.length - 1,
  heat: true,
  opacity: 0.65,
  sources: new Set(),
  mask: false,
  truth: true,
  boxes: true,
  map: true,
  percent: data.percents.length - 1,
};
const SVG = "http://www.w3.org/2000/svg";

function draw(tag, attributes) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

const outline = ([x0, y0, x1, y1]) => `M${x0} ${y0}H${x1}V${y1}H${x0}Z`;
const count = (number, one, many) => `${number} ${number === 1 ? one : many}`;
const isFound = (object) => (object.grades[data.methods[state.method]] ?? Infinity) <= state.percent;

function outcome(query) {
  if (!query.truth.length) return "unchanged";
  return query.truth.every(isFound) ? "found" : "missed";
}

function inWords(query) {
  if (query.truth === null) return query.boxes ? count(query.boxes.length, "candidate box", "candidate boxes") : "";
  if (!query.truth.length) return "unchanged";
  const found = query.truth.filter(isFound).length;
  const objects = count(query.truth.length, "changed object", "changed objects");
  return `${objects}, ${found} found by ${data.methods[state.method]} at X = ${data.percents[state.percent]} %`;
}

function cells(query, address, kind, said) {
  const image = make("img", {class: `cells ${kind}`, alt: said, src: address});
  const [columns, rows] = query.grid;
  image.style.width = `${(100 * data.cell * columns) / query.size[0]}%`; // the last cells reach over the border
  image.style.height = `${(100 * data.cell * rows) / query.size[1]}%`;
  return image;
}

function scene(query) {
  const [width, height] = query.size;
  const box = make("div", {class: "scene"});
  box.style.aspectRatio = `${width} / ${height}`;
  box.append(make("img", {class: "photo", alt: `Query ${query.name}`, src: data.images[query.image]}));
  box.append(cells(query, query.heat[state.method], "heat", ""));
  if (query.mask) box.append(cells(query, query.mask, "mask", "Masked cells"));
  const lines = draw("svg", {viewBox: `0 0 ${width} ${height}`, role: "img", class: "lines"});
  for (const [source, {path}] of Object.entries(query.obbs)) {
    lines.append(draw("path", {d: path, class: `obb source-${sources.indexOf(source) % 6}`, "data-source": source}));
  }
  lines.append(draw("path", {class: "candidate"}));
  lines.append(draw("path", {class: "truth missed"}), draw("path", {class: "truth found"}));
  box.append(lines);
  refresh(box, query);
  return box;
}

function refresh(box, query) {
  const heat = box.querySelector(".heat");
  heat.src = query.heat[state.method];
  heat.alt = `Likelihood of change by ${data.methods[state.method]}`;
  heat.hidden = !state.heat;
  box.classList.toggle("heated", state.heat);
  const mask = box.querySelector(".mask");
  if (mask) mask.hidden = !state.mask;
  const said = box.dataset.told ? [box.dataset.told] : [];
  for (const path of box.querySelectorAll(".obb")) {
    const shown = state.sources.has(path.dataset.source);
    path.style.display = shown ? "" : "none";
    if (shown) said.push(`${query.obbs[path.dataset.source].count} OBBs of ${path.dataset.source}`);
  }
  const truth = state.truth ? query.truth ?? [] : [];
  const drawn = (wanted) => truth.filter((one) => isFound(one) === wanted).map((one) => outline(one.box)).join("");
  box.querySelector(".truth.missed").setAttribute("d", drawn(false));
  box.querySelector(".truth.found").setAttribute("d", drawn(true));
  if (truth.length) said.push(inWords(query));
  const boxes = state.boxes ? query.boxes ?? [] : [];
  box.querySelector(".candidate").setAttribute("d", boxes.map(outline).join(""));
  if (boxes.length) said.push(count(boxes.length, "candidate box", "candidate boxes"));
  box.querySelector(".lines").setAttribute("aria-label", said.join("; ") || "No outlines");
}

function memory(query, place) {
  const hypothesis = query.hypotheses[place];
  return make("img", {class: "photo", alt: `Map image ${hypothesis.name}`, src: data.images[hypothesis.image]});
}

function placeInWords(query, place) {
  const {right} = query.hypotheses[place];
  return right === null ? "" : right ? ", right place" : ", wrong place";
}
