"use strict";
// Fills `data-fragment` elements with what their address answers; 202: it is being worked out.

(() => {
  const wait = (seconds) => new Promise((resolve) => { setTimeout(resolve, 1000 * seconds); });

  function tell(place, text) {
    const note = document.createElement("p");
    note.className = "note";
    note.setAttribute("role", "status");
    note.textContent = text.replaceAll("`", "");
    place.replaceChildren(note);
  }

  const isPage = (answer) => (answer.headers.get("Content-Type") ?? "").startsWith("text/html");

  async function show(place, answer) {
    if (isPage(answer)) {
      place.innerHTML = await answer.text();
    } else {
      const { message, remedy } = await answer.json();
      tell(place, [message, remedy].filter(Boolean).join(" "));
    }
  }

  async function fill(place) {
    try {
      for (;;) {
        const answer = await fetch(place.dataset.fragment);
        await show(place, answer);
        if (answer.status === 202) {
          await wait(Number(answer.headers.get("Retry-After")) || 2);
          continue;
        }
        return;
      }
    } catch (error) {
      tell(place, `This part did not load: ${error.message}`);
    }
  }

  document.addEventListener("DOMContentLoaded", () => {
    document.querySelectorAll("[data-fragment]").forEach(fill);
  });
})();
