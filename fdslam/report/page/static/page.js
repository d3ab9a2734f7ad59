// For every page: light and dark, tables that are sorted, and small helpers. Texts are only ever set as text.

function make(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

function look() {
  const button = document.getElementById("look");
  const wanted = matchMedia("(prefers-color-scheme: dark)");
  const dark = () => (document.documentElement.dataset.look ?? (wanted.matches ? "dark" : "light")) === "dark";
  const say = () => { button.textContent = dark() ? "Light" : "Dark"; };
  button.addEventListener("click", () => {
    document.documentElement.dataset.look = dark() ? "light" : "dark";
    say();
  });
  wanted.addEventListener("change", say);
  button.hidden = false;
  say();
}

function sortable(table) {
  const body = table.tBodies[0];
  const heads = [...table.tHead.rows[0].cells];
  const first = [...body.rows];
  const text = (row, column) => row.cells[column].textContent.trim();
  heads.forEach((head, column) => {
    const number = first.every((row) => /^(–$|-?[\d.]+)/.test(text(row, column)));
    const compare = (a, b) => {
      const [left, right] = [text(a, column), text(b, column)];
      if (left === "–" || right === "–") return (left === "–") - (right === "–");
      return (number ? parseFloat(right) - parseFloat(left) : left.localeCompare(right, undefined, {numeric: true})) * turn;
    };
    let turn = 1;
    const button = make("button", {type: "button"}, ...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      turn = head.hasAttribute("aria-sort") ? -turn : 1;
      heads.forEach((each) => each.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", (turn > 0) === number ? "descending" : "ascending");
      body.append(...[...body.rows].sort(compare));
    });
  });
}

look();
document.querySelectorAll("table.sortable").forEach(sortable);
