import { post } from "./api.js";
import { byId, el, setText } from "./dom.js";

/** Messages that the page keeps. */
const KEPT = 200;

/**
 * @typedef {object} Proposal
 * @property {string} id @property {{intent: string, parameters: any}[]} commands
 * @property {string[]} says @property {string[]} effect @property {number} expires_in [s]
 */

/** A change that waits for the user's word, as a card in the chat. */
class Card {
  /**
   * @param {Proposal} proposal
   * @param {{again: () => void, edit: () => void, decided: (card: Card) => void}} asked
   */
  constructor(proposal, asked) {
    this.proposal = proposal;
    this.asked = asked;
    this.open = true;
    this.until = performance.now() + 1000 * proposal.expires_in;
    const button = (/** @type {string} */ name, /** @type {string} */ label, /** @type {() => void} */ onclick) =>
      el("button", { type: "button", class: name, onclick }, label);
    this.confirmButton = button("primary", "Confirm", () => this.confirm());
    this.left = el("span", { class: "left", role: "timer", "aria-live": "off" });
    this.actions = el(
      "div",
      { class: "actions" },
      this.confirmButton,
      button("", "Edit", () => this.edit()),
      button("", "Reject", () => this.reject()),
      this.left,
    );
    this.outcome = el("p", { class: "outcome", hidden: true });
    this.node = el(
      "div",
      { class: "card", role: "group", "aria-label": "Proposal" },
      el("p", { class: "says" }, sentence(proposal.says.join("; "))),
      el("ul", { class: "effect" }, ...proposal.effect.map((line) => el("li", {}, line))),
      this.actions,
      this.outcome,
    );
    this.tick();
  }

  /** Count down. */
  tick() {
    if (!this.open) return;
    const seconds = Math.ceil((this.until - performance.now()) / 1000);
    if (seconds > 0) setText(this.left, `expires in ${seconds} s`);
    else this.#close("Expired: nothing was changed.", true);
  }

  /** Let it happen. */
  async confirm() {
    if (!this.open) return;
    this.open = false;
    this.confirmButton.setAttribute("disabled", "");
    try {
      const { seq } = await post(`/api/proposals/${this.proposal.id}/confirm`, {});
      this.#close(`Confirmed, event ${seq}.`, false);
    } catch (error) {
      const unknown = "No answer. The events show whether it happened.";
      this.#close(error.status === 0 ? unknown : `Not done: ${messageOf(error)}`, true);
    }
  }

  /** Drop it. @param {string} [why] */
  reject(why = "Rejected") {
    if (!this.open) return;
    this.#close(`${why}: nothing was changed.`, false);
    post(`/api/proposals/${this.proposal.id}/reject`, {}).catch(() => {});
  }

  /** Drop it, and let the user word it anew. */
  edit() {
    if (!this.open) return;
    this.reject();
    this.asked.edit();
  }

  /** @param {string} outcome @param {boolean} again whether it may be asked once more */
  #close(outcome, again) {
    this.open = false;
    const held = this.node.contains(document.activeElement);
    this.actions.remove();
    this.outcome.hidden = false;
    this.outcome.append(outcome);
    if (again) {
      this.outcome.append(" ", el("button", { type: "button", onclick: () => this.asked.again() }, "Ask again"));
    }
    this.node.classList.add("closed");
    if (held) byId("say").focus();
    this.asked.decided(this);
  }
}

/** The dialogue with the mission: words in; questions, answers and proposals out. */
export class Chat {
  /** @param {import("./world.js").World} world */
  constructor(world) {
    this.world = world;
    this.log = byId("log");
    this.input = /** @type {HTMLInputElement} */ (byId("say"));
    /** The proposal that waits. @type {Card | null} */
    this.card = null;
    /** @type {string[]} */
    this.said = [];
    this.back = 0;
    byId("chat-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.say(this.input.value);
    });
    this.input.addEventListener("keydown", (event) => this.#recall(event));
    setInterval(() => this.card?.tick(), 1000);
  }

  /** Send words to the mission. @param {string} text */
  async say(text) {
    if (!text.trim()) return;
    this.said.push(text);
    this.back = 0;
    this.input.value = "";
    this.#add("you", text);
    const again = () => this.say(text);
    const edit = () => this.#put(text);
    await this.#ask("/api/instructions", { text }, again, edit);
  }

  /**
   * Ask for commands that a tool or a table made.
   * @param {{intent: string, parameters: object}[]} commands @param {string} words
   * @param {() => void} [edit] opens what made them again
   */
  async propose(commands, words, edit) {
    this.#add("you", words);
    const again = () => this.propose(commands, words, edit);
    await this.#ask("/api/proposals", { commands }, again, edit ?? (() => this.#put(words)));
  }

  /** @param {string} path @param {object} body @param {() => void} again @param {() => void} edit */
  async #ask(path, body, again, edit) {
    const wait = el("p", { class: "oath wait" }, "…");
    this.#append(wait);
    try {
      const { reply } = await post(path, body);
      wait.remove();
      this.#answer(reply, again, edit);
    } catch (error) {
      wait.remove();
      this.#add("oath alarm", messageOf(error));
    }
  }

  /** @param {any} reply @param {() => void} again @param {() => void} edit */
  #answer({ status, message, proposal }, again, edit) {
    if (!proposal) return this.#add(status === "complete" ? "oath" : "oath question", message);
    this.card?.reject("Replaced by the next proposal");
    const decided = (/** @type {Card} */ card) => {
      if (this.card === card) this.card = null;
    };
    this.card = new Card(proposal, { again, edit, decided });
    return this.#append(this.card.node);
  }

  /** Say something on the mission's behalf. @param {string} text @param {boolean} [alarm] */
  tell(text, alarm = false) {
    this.#add(alarm ? "oath alarm" : "oath", text);
  }

  /** @param {string} text */
  #put(text) {
    this.input.value = text;
    this.input.focus();
    this.input.select();
  }

  /** @param {string} who @param {string} text */
  #add(who, text) {
    this.#append(el("p", { class: who }, text));
  }

  /** @param {HTMLElement} node */
  #append(node) {
    document.getElementById("hints")?.remove();
    this.log.append(node);
    while (this.log.children.length > KEPT) this.log.firstElementChild?.remove();
    this.log.scrollTop = this.log.scrollHeight;
  }

  /** The keys up and down bring back what was said. @param {KeyboardEvent} event */
  #recall(event) {
    const step = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    this.back = Math.max(0, Math.min(this.said.length, this.back + step));
    this.input.value = this.back ? this.said[this.said.length - this.back] : "";
  }
}

/** @param {string} text @returns {string} */
function sentence(text) {
  return `${text.charAt(0).toUpperCase()}${text.slice(1)}.`;
}

/** @param {unknown} error @returns {string} */
export function messageOf(error) {
  return error instanceof Error ? error.message : String(error);
}
