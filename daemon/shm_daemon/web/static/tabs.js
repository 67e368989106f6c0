"use strict";
// Shows the parts of a page one at a time, as tabs. A link to anything in a part opens that part.
// Without JavaScript, and on paper, all parts stand below each other.

(() => {
  const KEYS = { ArrowLeft: -1, ArrowRight: 1 };

  function open(tabs, chosen) {
    for (const { button, part } of tabs) {
      const isChosen = button === chosen.button;
      part.hidden = !isChosen;
      button.setAttribute("aria-selected", String(isChosen));
      button.tabIndex = isChosen ? 0 : -1;
    }
    dispatchEvent(new Event("resize")); // a figure that was hidden has missed it
  }

  function tabOf(tabs, address) {
    const place = address.length > 1 && document.getElementById(decodeURIComponent(address.slice(1)));
    return place && tabs.find(({ part }) => part.contains(place));
  }

  function follow(tabs) {
    const found = tabOf(tabs, location.hash);
    if (!found) return;
    open(tabs, found);
    document.getElementById(decodeURIComponent(location.hash.slice(1))).scrollIntoView();
  }

  function build(whole) {
    const list = document.createElement("div");
    list.className = "tabs only-screen";
    list.setAttribute("role", "tablist");
    list.setAttribute("aria-label", whole.dataset.tabs);
    const tabs = [...whole.querySelectorAll(":scope > [data-tab]")].map((part) => {
      const button = document.createElement("button");
      button.type = "button";
      button.id = `tab-${part.id}`;
      button.textContent = part.dataset.tab;
      button.setAttribute("role", "tab");
      button.setAttribute("aria-controls", part.id);
      part.setAttribute("role", "tabpanel");
      part.setAttribute("aria-labelledby", button.id);
      list.append(button);
      return { button, part };
    });
    tabs.forEach((tab, index) => {
      tab.button.addEventListener("click", () => {
        open(tabs, tab);
        history.replaceState(null, "", `#${tab.part.id}`);
      });
      tab.button.addEventListener("keydown", ({ key }) => {
        if (!(key in KEYS)) return;
        const next = tabs[(index + KEYS[key] + tabs.length) % tabs.length];
        open(tabs, next);
        next.button.focus();
      });
    });
    whole.prepend(list);
    open(tabs, tabOf(tabs, location.hash) || tabs[0]);
    follow(tabs);
    addEventListener("hashchange", () => follow(tabs));
  }

  document.addEventListener("DOMContentLoaded", () => {
    document.querySelectorAll("[data-tabs]").forEach(build);
  });
})();
