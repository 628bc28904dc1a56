import { el, setAttribute, setText } from "./dom.js";

/**
 * @template T
 * @typedef {object} Column
 * @property {string} key @property {string} label
 * @property {(item: T) => string} [text] what the cell says
 * @property {(item: T) => string | number} [sort] what rows are ordered by; the text if left out
 * @property {(cell: HTMLElement, item: T) => void} [build] makes a cell's content once
 * @property {(cell: HTMLElement, item: T) => void} [update] brings it up to date
 * @property {string} [class]
 */

/** Rows that are shown at once. */
const MOST = 200;

/**
 * A sortable, filterable table that keeps its rows: only what differs is touched.
 * @template T
 */
export class Table {
  /**
   * @param {HTMLElement} host @param {string} label
   * @param {Column<T>[]} columns
   * @param {{key: (item: T) => string, onChoose: (item: T) => void}} about
   */
  constructor(host, label, columns, about) {
    this.columns = columns;
    this.about = about;
    /** @type {T[]} */
    this.items = [];
    this.filter = "";
    /** @type {{column: Column<T>, down: boolean} | null} */
    this.order = null;
    /** @type {string | null} */
    this.selected = null;
    /** @type {Map<string, {row: HTMLElement, cells: HTMLElement[]}>} */
    this.rows = new Map();
    this.heads = columns.map((column) => this.#head(column));
    this.body = el("tbody", { onkeydown: (event) => this.#key(/** @type {KeyboardEvent} */ (event)) });
    this.note = el("p", { class: "empty", hidden: true });
    const head = el("thead", {}, el("tr", {}, ...this.heads));
    host.append(el("table", { role: "grid", "aria-label": label }, head, this.body), this.note);
  }

  /** @param {Column<T>} column */
  #head(column) {
    if (!column.label) return el("th", { class: column.class ?? "" }, el("span", { class: "unseen" }, column.key));
    const button = el("button", { type: "button", onclick: () => this.#sort(column) }, column.label);
    return el("th", { class: column.class ?? "", scope: "col", "aria-sort": "none" }, button);
  }

  /** @param {Column<T>} column */
  #sort(column) {
    const same = this.order?.column === column;
    this.order = same && this.order?.down ? null : { column, down: same };
    this.columns.forEach((other, i) => {
      if (!other.label) return;
      const chosen = other === this.order?.column;
      const way = this.order?.down ? "descending" : "ascending";
      this.heads[i].setAttribute("aria-sort", chosen ? way : "none");
    });
    this.show(this.items);
  }

  /** @param {string} text rows that do not contain it are hidden */
  setFilter(text) {
    this.filter = text.trim().toLowerCase();
    this.show(this.items);
  }

  /** @param {T[]} items what the table shows from now on */
  show(items) {
    this.items = items;
    const keys = new Set();
    const found = this.#sorted(items.filter((item) => this.#matches(item)));
    const shown = found.slice(0, MOST);
    let before = null;
    for (const item of shown) {
      const key = this.about.key(item);
      keys.add(key);
      const { row, cells } = this.rows.get(key) ?? this.#add(key, item);
      this.columns.forEach((column, i) => {
        if (column.text && !column.update) setText(cells[i], column.text(item));
        column.update?.(cells[i], item);
      });
      let next = before ? before.nextSibling : this.body.firstChild;
      if (next && next !== row && next.nextSibling === row) {
        this.body.append(next); // one row left: it need not push all others
        next = row;
      }
      if (next !== row) this.body.insertBefore(row, next);
      before = row;
    }
    for (const [key, { row }] of this.rows) {
      if (keys.has(key)) continue;
      row.remove();
      this.rows.delete(key);
    }
    this.note.hidden = found.length > 0 && found.length <= MOST;
    const more = `${MOST} of ${found.length} are shown; filter or sort to see others.`;
    setText(this.note, found.length ? more : items.length ? "Nothing matches the filter." : "Nothing here.");
    this.#mark();
  }

  /** @param {T} item */
  #matches(item) {
    return !this.filter || this.columns.some((column) => column.text?.(item).toLowerCase().includes(this.filter));
  }

  /** @param {T[]} items */
  #sorted(items) {
    if (!this.order) return items;
    const { column, down } = this.order;
    const value = column.sort ?? column.text ?? this.about.key;
    const sign = down ? -1 : 1;
    return [...items].sort((a, b) => sign * compare(value(a), value(b)));
  }

  /** @param {string} key @param {T} item */
  #add(key, item) {
    const cells = this.columns.map((column) => {
      const cell = el("td", { class: column.class ?? "" });
      column.build?.(cell, item);
      return cell;
    });
    const row = el("tr", { tabindex: -1, "data-key": key }, ...cells);
    row.addEventListener("click", (event) => {
      if (event.target instanceof Element && event.target.closest("button, select")) return;
      this.#choose(key);
    });
    const made = { row, cells };
    this.rows.set(key, made);
    return made;
  }

  /** @param {string} key */
  #choose(key) {
    const item = this.items.find((one) => this.about.key(one) === key);
    if (item) this.about.onChoose(item);
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const row = event.target instanceof HTMLElement ? event.target.closest("tr") : null;
    if (!row || event.target !== row) return;
    const to = { ArrowDown: row.nextElementSibling, ArrowUp: row.previousElementSibling, Home: this.body.firstElementChild, End: this.body.lastElementChild }[event.key];
    if (to instanceof HTMLElement) {
      event.preventDefault();
      row.tabIndex = -1;
      to.tabIndex = 0;
      to.focus();
    } else if (event.key === "Enter") {
      event.preventDefault();
      this.#choose(row.dataset.key ?? "");
    }
  }

  /** Mark a row as chosen. @param {string | null} key @param {boolean} [reveal] scroll to it */
  mark(key, reveal = false) {
    this.selected = key;
    this.#mark();
    if (reveal && key !== null) this.rows.get(key)?.row.scrollIntoView({ block: "nearest" });
  }

  #mark() {
    let first = true;
    for (const [key, { row }] of this.rows) {
      setAttribute(row, "aria-selected", String(key === this.selected));
    }
    const focused = document.activeElement;
    const stop = this.rows.get(this.selected ?? "")?.row ?? this.body.firstElementChild;
    for (const row of this.body.children) {
      if (!(row instanceof HTMLElement)) continue;
      const here = row === focused || (!this.body.contains(focused) && row === stop && first);
      if (here) first = false;
      const index = here || row === stop ? 0 : -1;
      if (row.tabIndex !== index) row.tabIndex = index;
    }
  }
}

const collator = new Intl.Collator("en", { numeric: true });

/** @param {string | number} a @param {string | number} b */
function compare(a, b) {
  return typeof a === "number" && typeof b === "number" ? a - b : collator.compare(String(a), String(b));
}
