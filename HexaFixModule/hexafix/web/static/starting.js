(function () {
  const PATIENCE = 100;
  const AGAIN_MS = 200;
  const find = (name) => document.querySelector("#hexafix-starting-" + name);
  let silent = 0;
  let seen = false;

  function tell(text) {
    if (find("text")) find("text").textContent = text;
  }

  function show(place) {
    seen = true;
    find("image").src = "starting.png";
    find("place").textContent = place;
    find("picture").hidden = false;
  }

  function begin() {
    const client = document.createElement("script");
    client.type = "module";
    client.crossOrigin = "";
    client.src = document.querySelector("link[rel=modulepreload]").href;
    document.head.append(client);
  }

  async function ask() {
    let wait = AGAIN_MS;
    try {
      const answer = await fetch("starting.json" + (seen ? "?seen" : ""));
      const state = await answer.json();
      if (state.ready) return void begin();
      silent = 0;
      tell(state.text);
      if (state.picture && !seen) show(state.picture);
      wait = state.wait_ms;
    } catch {
      silent += 1;
      if (silent > PATIENCE) tell("No answer: look at the terminal of hexafix serve.");
    }
    setTimeout(ask, wait);
  }

  ask();
})();
