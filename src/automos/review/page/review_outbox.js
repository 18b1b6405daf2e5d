"use strict";
/* What is said to the server, and decisions on their way: sent one after another, each kept until it is in the log. */
async function ask(path, body) {
  const content = body === undefined ? undefined : JSON.stringify(body);
  const sent = body === undefined ? {} : {
    method: "POST", headers: { "Content-Type": "application/json" }, body: content,
    keepalive: content.length < 60000, // outlives a closed tab; browsers allow no more
  };
  let answer, said;
  try {
    answer = await fetch(path, sent);
    said = await answer.json();
  } catch {
    throw new Error("automos review does not answer, it may have ended");
  }
  if (!answer.ok) throw new Error(said.error);
  return said;
}

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
    tracks: () => [...new Set(decisions.flatMap((decision) => decision.tracks))],
    get length() { return decisions.length; },
  };
}
