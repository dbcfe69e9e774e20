"use strict";
// what the index says more of this sequence, by a comparison with others: it is in compared.js, which the index wrote
(function () {
  var told = (window.compared || {})[document.querySelector("main").dataset.sequence];
  if (!told) return;
  function lit(light, one) {
    light.className = "light " + one.level;
    light.textContent = one.word;
  }
  function added(parent, name, words) {
    var element = document.createElement(name);
    element.textContent = words;
    parent.insertBefore(element, parent.firstChild);
    return element;
  }
  (told.fixes || []).slice().reverse().forEach(function (fix) {
    var line = added(document.getElementById("notes"), "p", ""), where = fix.file ? "in " + fix.file : "in a shell";
    line.className = "note fix";
    line.textContent = (fix.of ? "follows from " + fix.of + (fix.camera ? ", " : ": ") : "") + (fix.camera ? fix.camera + ": " : "") + where + (fix.at ? " " + fix.at : "") + (fix.literal ? " type " : ": ");
    line.appendChild(document.createElement(fix.literal ? "code" : "b")).textContent = fix.what;
    if (fix.gain) line.appendChild(document.createElement("small")).textContent = " " + fix.gain;
  });
  if (!told.cameras) return;
  lit(document.querySelector("h1 .light"), told);
  told.notes.slice().reverse().forEach(function (text) {
    added(document.getElementById("notes"), "p", text).className = "note";
  });
  Array.prototype.forEach.call(document.querySelectorAll(".cell"), function (cell) {
    var one = told.cameras[cell.dataset.camera];
    if (!one) return;
    cell.className = "cell " + one.level;
    lit(cell.querySelector(".light"), one);
    one.reasons.slice().reverse().forEach(function (text) { added(cell.querySelector("ul"), "li", text).className = "reason"; });
  });
})();
