"use strict";
/* What frames the review and the sample: a status line, a dialog over the page, keys. */
function makeFrame() {
  const byId = (id) => document.getElementById(id);
  const dialog = byId("over"), back = byId("over-back");

  dialog.addEventListener("cancel", (event) => { if (back.hidden) event.preventDefault(); }); // Escape
  back.addEventListener("click", () => dialog.close());

  return {
    tell(text, isProblem = false, title = "") {
      byId("saved").textContent = text;
      byId("saved").title = title;
      byId("saved").classList.toggle("problem", isProblem);
    },

    /* Say over the pictures what the page is waiting for; nothing, once it is there. */
    loading(text) {
      byId("loading").textContent = text;
      byId("loading").hidden = !text;
    },

    /* List keys and what they do: rows [keys, what]. */
    help(rows) {
      this.over("Keys", "");
      byId("over-text").replaceChildren(Look.element("table", {}, ...rows.map(([keys, what]) => Look.element("tr", {},
        Look.element("td", {}, ...keys.split(" ").map((key) => Look.element("kbd", {}, key))), Look.element("td", {}, what)))));
    },

    /* Say something that has to be seen; while something is written (`isBusy`) there is no way back. */
    over(title, text, isBusy = false) {
      byId("over-title").textContent = title;
      byId("over-text").textContent = text;
      back.hidden = isBusy;
      if (!dialog.open) dialog.showModal();
      back.focus();
    },

    /* Do on a key what `find` returns for it, if that is anything; letters come in lower case. */
    onKeys(find) {
      document.addEventListener("keydown", (event) => {
        if (dialog.open || event.ctrlKey || event.metaKey || event.altKey) return;
        if (event.repeat && !event.key.startsWith("Arrow")) return; // a key held down decides once
        const on = event.target.tagName;
        if (on === "SELECT" || (on === "BUTTON" && (event.key === "Enter" || event.key === " "))) return; // it is their own
        const does = find(event.key.length === 1 ? event.key.toLowerCase() : event.key);
        if (does) { event.preventDefault(); does(); }
      });
    },

    /* Do on a click what `clicks` names by a button's id; keys are the page's again after it. */
    onClicks(clicks) {
      for (const [id, does] of Object.entries(clicks)) byId(id).addEventListener("click", (event) => { event.currentTarget.blur(); does(); });
    },
  };
}
