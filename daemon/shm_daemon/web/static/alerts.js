"use strict";
// Acknowledges or resolves an alert by the API; the page then shows what the record says.

(() => {
  const remembered = "shm.who";

  async function send(form) {
    const said = Object.fromEntries(new FormData(form));
    const answer = await fetch(form.dataset.address, {
      method: "POST",
      headers: { "Content-Type": "application/json", Accept: "application/json" },
      body: JSON.stringify(said),
    });
    const found = await answer.json();
    if (!answer.ok) throw new Error([found.message, found.remedy].filter(Boolean).join(" "));
    if (said.who) localStorage.setItem(remembered, said.who);
    return found;
  }

  function show(form, alert) {
    const card = form.closest(".card");
    const [done, by] = alert.resolved ? ["resolved", alert.resolved] : ["acknowledged", alert.acknowledged];
    const noted = document.createElement("p");
    noted.className = "noted";
    noted.textContent = `${done[0].toUpperCase()}${done.slice(1)} by ${by.who}: ${by.why}`;
    form.closest("details").replaceWith(noted);
    const told = document.getElementById("told");
    told.textContent = `Alert ${alert.id} is ${done}.`;
    card.tabIndex = -1;
    if (!card.classList.contains("open")) {
      card.focus();
      return;
    }
    card.classList.remove("open");
    const open = document.getElementById("open");
    open.dataset.count -= 1;
    open.textContent = `${open.dataset.title} (${open.dataset.count})`;
    const closed = document.querySelector("section[aria-labelledby=acknowledged]");
    if (closed) {
      closed.hidden = false;
      closed.querySelector("h2").after(card);
    }
    card.focus();
    const count = document.querySelector(".top .count");
    if (count) {
      const left = Number.parseInt(count.textContent, 10) - 1;
      if (left > 0) count.firstChild.textContent = left;
      else count.remove();
    }
  }

  document.addEventListener("DOMContentLoaded", () => {
    for (const form of document.querySelectorAll("form.acknowledge")) {
      // Who signed in by name is not asked for it.
      if (form.elements.who) form.elements.who.value = localStorage.getItem(remembered) ?? "";
      form.addEventListener("submit", async (event) => {
        event.preventDefault();
        const button = form.querySelector("button");
        const problem = form.querySelector(".problem");
        button.disabled = true;
        problem.textContent = "";
        try {
          show(form, await send(form));
        } catch (error) {
          problem.textContent = `Not noted: ${error.message}`.replaceAll("`", "");
          button.disabled = false;
        }
      });
    }
  });
})();
