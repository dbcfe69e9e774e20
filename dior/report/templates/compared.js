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
    var line = added(document.getElementById("notes"), "p", ""), where = fix[1] ? "in " + fix[1] : "in a shell";
    line.className = "note fix";
    line.textContent = (fix[0] ? fix[0] + ": " : "") + where + " type ";
    line.appendChild(document.createElement("code")).textContent = fix[2];
    if (fix[3]) line.appendChild(document.createElement("small")).textContent = " " + fix[3];
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
