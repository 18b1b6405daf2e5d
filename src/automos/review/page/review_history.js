"use strict";
/* What was done, so that it can be taken back, the last first. Each entry says what it was, and how it is undone. */
function makeHistory(button) {
  const done = [];
  const show = () => {
    button.disabled = !done.length;
    button.title = done.length ? `take back: ${done.at(-1).what}` : "nothing to take back";
  };
  return {
    add(what, undo) { done.push({ what, undo }); show(); },
    /* Take back the last; resolves to what it was, null where there was nothing. What cannot be undone stays. */
    async undo() {
      if (!done.length) return null;
      const last = done.at(-1);
      await last.undo();
      done.splice(done.indexOf(last), 1);
      show();
      return last.what;
    },
  };
}
