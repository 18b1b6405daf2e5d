"use strict";
/* Decisions on their way: sent one after another, in their order, each kept until the server has it in its log. */
function makeOutbox(post, onSaved) {
  const decisions = []; // oldest first; the first may be on its way
  let sending = null;

  async function sendAll() {
    try {
      while (decisions.length) {
        await post(decisions[0]);
        onSaved(decisions.shift());
      }
    } finally {
      sending = null;
    }
  }

  return {
    /* Send what is left. Resolves once the server has all; rejects where one is not saved: it and later ones stay. */
    send() {
      if (!sending && decisions.length) sending = sendAll();
      return sending || Promise.resolve();
    },
    add: (decision) => decisions.push(decision),
    tracks: () => [...new Set(decisions.map((decision) => decision.track))],
    get length() { return decisions.length; },
  };
}
