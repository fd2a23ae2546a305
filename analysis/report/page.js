// Shows the text of a mark at the pointer; without it browsers show <title> later.
(() => {
  "use strict";
  const tip = document.createElement("div");
  tip.id = "tip";
  tip.hidden = true;
  document.body.append(tip);
  const hide = () => { tip.hidden = true; };
  const show = (event) => {
    const mark = event.target.closest("[data-tip]");
    if (!mark) { hide(); return; }
    tip.textContent = mark.dataset.tip;
    if (mark.matches(".robot")) {
      const { x, y, width, height } = mark.getBBox();
      const large = mark.ownerSVGElement.cloneNode();
      large.setAttribute("viewBox", `${x} ${y} ${width} ${height}`);
      large.append(mark.cloneNode(true));
      tip.append(large);
    }
    tip.hidden = false;
    const { width, height } = tip.getBoundingClientRect();
    const right = document.documentElement.clientWidth - width - 8;
    const below = event.clientY + 18;
    const fits = below + height < window.innerHeight;
    tip.style.left = `${Math.max(8, Math.min(event.clientX + 14, right))}px`;
    tip.style.top = `${fits ? below : event.clientY - height - 12}px`;
  };
  for (const plot of document.querySelectorAll("svg.plot")) {
    for (const title of plot.querySelectorAll("title")) {
      title.parentNode.dataset.tip = title.textContent;
      title.remove();
    }
    // Thin lines are hard to meet: an invisible wide one lies below each.
    for (const line of plot.querySelectorAll(".curve > path")) {
      const wide = line.cloneNode();
      wide.setAttribute("class", "wide");
      wide.removeAttribute("style");
      line.before(wide);
    }
    plot.addEventListener("pointermove", show);
    plot.addEventListener("pointerdown", show);
    plot.addEventListener("pointerleave", hide);
  }
  window.addEventListener("scroll", hide, { passive: true });
})();
