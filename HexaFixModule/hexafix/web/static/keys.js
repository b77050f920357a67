/* Ctrl+Z, Ctrl+Shift+Z and Escape for the whole page, on which the server decides; and the step
   that was opened is brought into view, since the one above it has closed. */
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
  const settled = 300; // ms until what was opened or closed has its size
  let shown = null;
  const bring = () => {
    if (!shown.isConnected) return;
    shown.scrollIntoView({ block: "nearest" });
    shown.querySelector(".hxp-head").scrollIntoView({ block: "nearest" });
  };
  const follow = () => {
    const open = document.querySelector(".hxp-open");
    if (!open || open === shown) return;
    const first = shown === null;
    shown = open;
    if (first) return;
    bring();
    setTimeout(bring, settled);
  };
  new MutationObserver(follow).observe(document, {
    subtree: true,
    attributeFilter: ["class"],
  });
})();
