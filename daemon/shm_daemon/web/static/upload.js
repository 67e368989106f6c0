"use strict";
// Sends the chosen files one after the other and follows each until it is a test.

(() => {
  const WORDS = {
    received: "Taken in; its modes are being identified …",
    identified: "Its modes are identified; the tension is updated next. The first tests of a hanger " +
      "wait here until there are enough for a baseline.",
    updated: "The tension is updated; it is compared with the baseline …",
    watched: "Compared with the baseline; alerts are sent …",
    done: "Done.",
  };
  const FIRST_S = 1;
  const LONGEST_S = 15;
  const said = (fault) => [fault.message, fault.remedy].filter(Boolean).join(" ").replaceAll("`", "");
  const size = (bytes) => bytes < 1e6
    ? `${Math.max(1, Math.round(bytes / 1e3))} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
  const rounded = (value) => Number(value.toPrecision(3)); // never 1.86e+3
  const made = (name, values = {}) => Object.assign(document.createElement(name), values);
  const rest = (seconds) => new Promise((resolve) => { setTimeout(resolve, 1000 * seconds); });
  let queue = Promise.resolve();
  let counted = 0;
  let form, list, told;

  function listed(file) {
    const item = made("li", { className: "card" });
    const bar = made("progress", { max: 1, value: 0 });
    bar.setAttribute("aria-label", `Upload of ${file.name}`);
    const stage = made("p", { className: "stage", textContent: "Waits for the file before it." });
    item.append(made("h3", { textContent: file.name }),
      made("p", { className: "note", textContent: size(file.size) }), bar, stage);
    list.append(item);
    return { item, bar, stage, name: file.name, number: list.children.length };
  }

  function state(row, text, kind = "") {
    if (row.stage.textContent !== text) row.stage.textContent = text;
    row.item.className = `card ${kind}`;
  }

  function failed(row, text) {
    row.bar.remove();
    state(row, text, "failed");
    told.textContent = `${row.name}: ${text}`;
  }

  function address(file) {
    const query = new URLSearchParams({ name: file.name });
    for (const name of ["hanger", "temperature_c"]) {
      const value = form.elements[name].value.trim();
      if (value) query.set(name, value);
    }
    return `/api/recordings?${query}`;
  }

  function sent(file, row) {
    return new Promise((resolve, reject) => {
      const request = new XMLHttpRequest();
      request.open("POST", row.address);
      request.setRequestHeader("Content-Type", "application/octet-stream");
      request.responseType = "json";
      request.upload.onprogress = ({ loaded, total }) => {
        row.bar.value = total ? loaded / total : 0;
        state(row, `Sent ${size(loaded)} of ${size(total)}.`);
      };
      request.onload = () => {
        const answer = request.response ?? {};
        if (request.status < 300) resolve(answer);
        else reject(new Error(said(answer) || `The answer was ${request.status}.`));
      };
      request.onerror = () => reject(new Error("The connection broke off. Send it again."));
      request.send(file);
    });
  }

  // ---- the first file of a logger

  const BARS = " ▁▂▃▄▅▆▇█";
  const SENT_AS_THEY_ARE = [".zip", ".modes.json"];

  async function looked(file, answers) {
    const query = new URLSearchParams({ name: file.name });
    if (answers) query.set("said", JSON.stringify(answers));
    const answer = await fetch(`/api/imports?${query}`, {
      method: "POST", body: file, headers: { "Content-Type": "application/octet-stream" },
    });
    const found = await answer.json();
    if (!answer.ok) throw new Error(said(found));
    return found;
  }

  function cells(column) {
    const unit = column.quantity === "force" ? "N" : "m/s²";
    const range = column.largest === null ? ""
      : `${rounded(column.least)} to ${rounded(column.largest)} ${unit}`;
    const seen = [column.hits === null ? "" : `${column.hits} hits`,
      column.is_clipped ? "clipped" : ""].filter(Boolean).join(", ");
    const picture = column.outline.map((share) => BARS[Math.round(8 * share)]).join("");
    return [column.name, column.unit, column.quantity ?? "left out", range, seen, picture];
  }

  function tableOf(found) {
    const table = made("table", { className: "stacked" });
    const head = made("tr");
    for (const textContent of ["Column", "Unit", "Taken for", "Range", "Seen", "Over time"]) {
      head.append(made("th", { textContent, scope: "col" }));
    }
    table.createTHead().append(head);
    const body = table.createTBody();
    for (const column of found.columns) {
      const line = made("tr");
      const [name, ...others] = cells(column);
      line.append(made("th", { textContent: name, scope: "row" }));
      for (const textContent of others) line.append(made("td", { textContent }));
      body.append(line);
    }
    return table;
  }

  // Resolves to the answers, or to null where the file is to be sent as it is.
  function asked(found, row) {
    return new Promise((resolve) => {
      const part = made("div");
      const box = made("form", { className: "questions" });
      const fields = [...found.of_test, ...found.questions].map((question, index) => {
        const id = `question-${row.number}-${index}`;
        const input = made("input", { id, type: "text" });
        input.required = found.questions.includes(question);
        const line = made("div");
        const choices = made("datalist", { id: `${id}-choices` });
        choices.append(...question.choices.map((value) => made("option", { value })));
        if (question.choices.length) input.setAttribute("list", choices.id);
        line.append(made("label", { htmlFor: id, textContent: question.text }), input, choices);
        box.append(line);
        return [question, input];
      });
      const carried = made("input", { id: `carried-${row.number}`, type: "checkbox", checked: true });
      if (found.questions.some(({ about }) => about === "hanger")) {
        const label = made("label", { htmlFor: carried.id, className: "carried" });
        label.append(carried, " This logger goes from hanger to hanger: ask each time");
        box.append(label);
      }
      const plain = made("button", { type: "button", className: "plain", textContent: "Send as it is" });
      const buttons = made("p", { className: "carried" });
      buttons.append(made("button", { textContent: "Keep for this logger, and send" }), " ", plain);
      box.append(buttons);
      part.append(tableOf(found), box);
      row.item.append(part);
      const ended = (answers) => { part.remove(); resolve(answers); };
      plain.addEventListener("click", () => ended(null));
      box.addEventListener("submit", (event) => {
        event.preventDefault();
        const answers = { columns: {}, ...(carried.isConnected && carried.checked && { each_time: true }) };
        for (const [{ about, channel }, { value }] of fields) {
          if (value === "") continue;
          if (about === "hanger") answers.hanger = Number(value);
          else if (about === "rate") answers.sampling_rate_hz = Number(value);
          else if (["time", "temperature", "operator"].includes(about)) answers[about] = value;
          else (answers.columns[channel] ??= {})[about] = value;
        }
        ended(answers);
      });
    });
  }

  const written = (name) => {
    const value = form.elements[name].value.trim();
    return value ? Number(value) : undefined;
  };

  // Whether the file went on its way with what a person said of it.
  async function imported(file, row) {
    if (SENT_AS_THEY_ARE.some((ending) => file.name.toLowerCase().endsWith(ending))) return false;
    const given = { hanger: written("hanger"), temperature_c: written("temperature_c"), columns: {} };
    let found;
    try {
      found = await looked(file, null);
    } catch {
      return false; // sent as it is, it is refused with its reason
    }
    const said = { hanger: given.hanger, temperature: given.temperature_c };
    const isOpen = ({ about }) => said[about] === undefined;
    found.questions = found.questions.filter(isOpen);
    found.of_test = found.of_test.filter(isOpen);
    while (found.questions.length && !found.sha256) {
      state(row, "Say what the file does not: it is kept for all files of this logger.", "open");
      const answers = await asked(found, row);
      if (answers === null) return false;
      for (const [name, more] of Object.entries(answers.columns)) {
        given.columns[name] = { ...given.columns[name], ...more };
      }
      Object.assign(given, { ...answers, columns: given.columns });
      let next;
      try {
        next = await looked(file, given);
      } catch (error) {
        told.textContent = `${row.name}: ${error.message}`;
        continue;
      }
      found = next;
      if (found.problems.length) throw new Error(found.problems.join(" "));
    }
    if (!found.sha256) return false;
    row.bar.value = 1;
    state(row, "Safe on the disk; the daemon takes it next.");
    told.textContent = `${row.name} is safe on the disk.`;
    follow(`/api/recordings?sha256=${found.sha256}`, row);
    return true;
  }

  async function one(file, row) {
    if (file.size > Number(form.dataset.maxBytes)) {
      failed(row, `Not sent: it is larger than ${size(Number(form.dataset.maxBytes))}.`);
      return;
    }
    try {
      if (await imported(file, row)) return;
      const landed = await sent(file, row);
      row.bar.value = 1;
      const again = landed.outcome === "duplicate" ? " These bytes were known already." : "";
      state(row, `Safe on the disk; the daemon takes it next.${again}`);
      told.textContent = `${row.name} is safe on the disk.`;
      follow(`/api/recordings?sha256=${landed.sha256}`, row);
    } catch (error) {
      failed(row, `Not taken: ${error.message}`);
    }
  }

  async function follow(statusUrl, row) {
    for (let wait = FIRST_S; ; wait = Math.min(1.3 * wait, LONGEST_S)) {
      await rest(wait);
      if (document.hidden) continue;
      let answer, found;
      try {
        answer = await fetch(statusUrl, { headers: { Accept: "application/json" } });
        found = await answer.json();
      } catch {
        state(row, "The interface does not answer; it is asked again …");
        continue;
      }
      if (!answer.ok && answer.status !== 503) {
        failed(row, said(found));
        return;
      }
      const [recording] = found.recordings ?? []; // none while it is in the spool
      if (recording && await shown(recording, row)) return;
    }
  }

  // Shows why a file is held or refused, with a link or form for what to do.
  async function stopped({ id, stage }, row) {
    const answer = await fetch(`/upload/outcome/${id}`);
    if (!answer.ok) return false;
    row.bar.remove();
    state(row, stage === "held" ? "Held: it counts in nothing until somebody decides." : "", "failed");
    const outcome = made("div", { className: "outcome" });
    outcome.innerHTML = await answer.text();
    row.item.append(outcome);
    told.textContent = `${row.name} is ${stage}.`;
    return true;
  }

  async function shown(recording, row) {
    const { stage } = recording;
    if (stage === "refused" || stage === "held") return stopped(recording, row);
    state(row, WORDS[stage] ?? stage, stage === "done" ? "done" : "");
    links(recording, row);
    if (stage === "done") {
      row.bar.remove();
      told.textContent = `${row.name} is a test now.`;
    }
    return stage === "done";
  }

  function links(recording, row) {
    if (row.item.querySelector(".links") || !recording.tests.length) return;
    const line = made("p", { className: "links" });
    line.append(made("a", {
      href: `/hangers/${recording.hanger}`, textContent: `Hanger ${recording.hanger}`,
    }));
    for (const test of recording.tests) {
      line.append(" · ", made("a", { href: test.page, textContent: `Test ${test.name}` }));
    }
    row.item.append(line);
  }

  function begin(files) {
    for (const file of files) {
      const row = listed(file);
      row.address = address(file);
      counted += 1;
      queue = queue.then(() => one(file, row));
    }
    told.textContent = `${counted} ${counted === 1 ? "file" : "files"} chosen.`;
  }

  document.addEventListener("DOMContentLoaded", () => {
    form = document.getElementById("upload");
    if (!form) return;
    list = document.getElementById("list");
    told = document.getElementById("told");
    const drop = document.getElementById("drop");
    const input = document.getElementById("files");
    form.addEventListener("submit", (event) => event.preventDefault());
    input.addEventListener("change", () => {
      begin([...input.files]);
      input.value = "";
    });
    for (const kind of ["dragenter", "dragover"]) {
      drop.addEventListener(kind, (event) => {
        event.preventDefault();
        drop.classList.add("over");
      });
    }
    for (const kind of ["dragleave", "drop"]) {
      drop.addEventListener(kind, () => drop.classList.remove("over"));
    }
    drop.addEventListener("drop", (event) => {
      event.preventDefault();
      begin([...event.dataTransfer.files]);
    });
  });
})();
