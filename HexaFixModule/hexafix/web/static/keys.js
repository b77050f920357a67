/* Ctrl+Z, Ctrl+Shift+Z and Escape for the whole page; the server decides what they do. */
(() => {
  const typing =
    'input:not([readonly]):not([type=checkbox]):not([type=radio]):not([type=range]), textarea';
  const ask = (name) => window.trame && window.trame.trigger(name);
  window.addEventListener("keydown", (event) => {
    if (event.key === "Escape") {
      ask("hx_escape");
      return;
    }
    const undo = (event.ctrlKey || event.metaKey) && !event.altKey;
    if (!undo || event.key.toLowerCase() !== "z" || event.target.closest?.(typing)) return;
    event.preventDefault();
    ask(event.shiftKey ? "hx_redo" : "hx_undo");
  });
})();
