"use strict";
(function () {
  var figures = JSON.parse(document.getElementById("figures").textContent);
  var dark = window.matchMedia("(prefers-color-scheme: dark)");
  var options = { responsive: true, displaylogo: false, displayModeBar: false, scrollZoom: false };

  var touch = window.matchMedia("(pointer: coarse)").matches;

  function theme(isDark) {
    return isDark
      ? { text: "#c9d1dc", grid: "#2e3540", line: "#4a5361", hover: "#262c35" }
      : { text: "#333a45", grid: "#e6e9ee", line: "#b4bbc6", hover: "#ffffff" };
  }

  function axisLook(axis, look) {
    return Object.assign({ gridcolor: look.grid, linecolor: look.line, zerolinecolor: look.line }, axis);
  }

  // The page's colours go under what a figure asks for itself.
  function themed(layout, isDark) {
    var look = theme(isDark), copy = JSON.parse(JSON.stringify(layout));
    copy.paper_bgcolor = "rgba(0,0,0,0)";
    copy.plot_bgcolor = "rgba(0,0,0,0)";
    copy.font = { family: "system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif", size: 12, color: look.text };
    copy.hoverlabel = { bgcolor: look.hover, bordercolor: look.line, font: { color: look.text } };
    // A finger scrolls the page; a mouse zooms.
    if (touch && !copy.scene) copy.dragmode = false;
    copy.xaxis = copy.xaxis || {};
    copy.yaxis = copy.yaxis || {};
    // Of figures with several panels too: xaxis, yaxis, yaxis2, yaxis3 and so on.
    Object.keys(copy).filter(function (name) { return /^[xy]axis\d*$/.test(name); })
      .forEach(function (name) { copy[name] = axisLook(copy[name], look); });
    if (copy.scene) {
      ["xaxis", "yaxis", "zaxis"].forEach(function (name) { copy.scene[name] = axisLook(copy.scene[name], look); });
    }
    return copy;
  }

  // As many hold numbers as there is room for; zooming in shows more.
  function thinned(place, data) {
    var index = data.findIndex(function (trace) { return trace.meta === "numbers"; });
    if (index < 0) return;
    var all = data[index].text;
    function fit() {
      var axis = place._fullLayout.xaxis, last = -1e9;
      var shown = all.map(function (text, k) {
        var at = axis.d2p(data[index].x[k]), room = 7 * text.length + 5;
        if (at < 0 || at > axis._length || at - last < room) return "";
        last = at;
        return text;
      });
      if (shown.join() !== (place.data[index].text || []).join()) Plotly.restyle(place, { text: [shown] }, [index]);
    }
    fit();
    if (!place.thinned) {
      place.thinned = true;
      place.on("plotly_relayout", fit);
      window.addEventListener("resize", function () { setTimeout(fit, 200); });
    }
  }

  function canTurn() {
    try {
      var canvas = document.createElement("canvas");
      return !!(canvas.getContext("webgl") || canvas.getContext("experimental-webgl"));
    } catch (error) { return false; }
  }
  var turns = canTurn();

  // Paper is narrower than most screens, does not tell its width, and keeps no 3D canvas.
  function draw(isDark, onPaper) {
    figures.forEach(function (figure) {
      var plot = figure.fallback && (onPaper || !turns) ? figure.fallback : figure;
      var place = document.getElementById(figure.name);
      var layout = themed(plot.layout, isDark);
      if (onPaper) layout.width = place.parentNode.classList.contains("many") ? 225 : 690;
      // A sphere on a narrow screen: as high as wide, or its sides are cut off.
      if (layout.scene) layout.height = Math.min(layout.height, place.clientWidth);
      place.style.height = layout.height + "px";
      Plotly.react(place, plot.data, layout, options).then(function () {
        thinned(place, JSON.parse(JSON.stringify(plot.data)));
      });
    });
  }

  draw(dark.matches);
  dark.addEventListener("change", function (event) { draw(event.matches); });
  window.addEventListener("beforeprint", function () { draw(false, true); });
  window.addEventListener("afterprint", function () { draw(dark.matches); });
})();
