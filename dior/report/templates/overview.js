"use strict";
// sort, filter and unfold the table of cameras; without it all of the table is shown
(function () {
  var table = document.getElementById("overview");
  var bodies = Array.prototype.slice.call(table.querySelectorAll("tbody.camera"));
  var folds = Array.prototype.slice.call(table.querySelectorAll("tbody.fold"));
  var open = {}, sorted = false;
  var order = ["bad", "look", "good", "none"];

  function unfold(body, whole) {
    Array.prototype.forEach.call(body.querySelectorAll("tr.recording"), function (row) { row.hidden = !whole; });
    var button = body.querySelector("button.more");
    if (button) button.setAttribute("aria-expanded", String(whole));
  }
  bodies.forEach(function (body) {
    unfold(body, false);
    var button = body.querySelector("button.more");
    if (button) button.addEventListener("click", function () {
      unfold(body, button.getAttribute("aria-expanded") !== "true");
    });
  });
  window.addEventListener("beforeprint", function () { bodies.forEach(function (body) { unfold(body, true); }); });

  function key(body, column) {
    if (column === 1) return body.dataset.name;
    var cell = body.rows[0].cells[column];
    if (cell.dataset.by === undefined) return order.indexOf(body.dataset.level);
    return cell.dataset.by === "" ? Infinity : Number(cell.dataset.by.replace("inf", "Infinity"));
  }
  Array.prototype.forEach.call(table.tHead.rows[0].cells, function (head, column) {
    var button = document.createElement("button");
    button.type = "button";
    while (head.firstChild) button.appendChild(head.firstChild);
    head.appendChild(button);
    button.addEventListener("click", function () {
      var descending = head.getAttribute("aria-sort") === "ascending";
      Array.prototype.forEach.call(table.tHead.rows[0].cells, function (one) { one.removeAttribute("aria-sort"); });
      head.setAttribute("aria-sort", descending ? "descending" : "ascending");
      sorted = true;
      show();
      bodies.map(function (body, i) { return [key(body, column), i, body]; }).sort(function (a, b) {
        var first = a[0] < b[0] ? -1 : a[0] > b[0] ? 1 : 0;
        return (descending ? -first : first) || a[1] - b[1];
      }).forEach(function (one) { table.appendChild(one[2]); });
    });
  });

  var tools = document.getElementById("overview-tools");
  tools.hidden = false;
  var words = tools.querySelector("input[type=search]"), wrong = tools.querySelector("input[type=checkbox]");
  // good cameras are folded as long as nobody looks for any
  function show() {
    var word = words.value.trim().toLowerCase(), all = word || sorted;
    bodies.forEach(function (body) {
      var named = !word || body.textContent.toLowerCase().indexOf(word) >= 0;
      var folded = !all && body.dataset.fold && !open[body.dataset.fold];
      body.hidden = !named || folded || (wrong.checked && body.dataset.level === "good");
    });
    document.getElementById("overview-none").hidden = !word || bodies.some(function (body) { return !body.hidden; });
    folds.forEach(function (fold) {
      fold.hidden = all || wrong.checked;
      fold.querySelector("button").setAttribute("aria-expanded", String(!!open[fold.dataset.fold]));
    });
  }
  folds.forEach(function (fold) {
    fold.querySelector("button").addEventListener("click", function () {
      open[fold.dataset.fold] = !open[fold.dataset.fold];
      show();
    });
  });
  window.addEventListener("beforeprint", function () {
    folds.forEach(function (fold) { open[fold.dataset.fold] = true; });
    show();
  });
  words.addEventListener("input", show);
  wrong.addEventListener("change", show);
  show();
})();
