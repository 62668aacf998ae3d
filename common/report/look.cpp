#include "report/look.hpp"

namespace subworld {

// gnuplot writes its colours as attributes, over which a rule wins: texts and grid follow the theme, curves do not.
const char* page_head() noexcept {
  return R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
<style>
:root { color-scheme: light dark; --ink: #1f262e; --soft: #566270; --paper: #fff; --panel: #f4f6f9; --line: #dfe4ea;
  --accent: #0072b2; --good: #00704f; --good-paper: #eaf6f1; --bad: #b3261e; --bad-paper: #fdeeec; --warn: #8a6100;
  --warn-paper: #fdf6e3; }
@media (prefers-color-scheme: dark) { :root { --ink: #dde3ea; --soft: #98a5b3; --paper: #14181d; --panel: #1d232b;
  --line: #323b46; --accent: #4fa8dd; --good: #4cc79b; --good-paper: #142a23; --bad: #ff8a80; --bad-paper: #331a19;
  --warn: #e5b94c; --warn-paper: #2d2612; } .plots svg { filter: brightness(1.35); } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 1500px;
  margin: 2em auto; padding: 0 1.5em; }
h1 { font-size: 1.7em; margin: 0 0 0.2em; } h2 { margin: 2.2em 0 0.7em; font-size: 1.3em;
  border-bottom: 2px solid var(--accent); padding-bottom: 0.15em; } h3 { margin: 1.4em 0 0.4em; font-size: 1.05em; }
p { max-width: 70em; } .facts { color: var(--soft); } code { font-size: 0.92em; overflow-wrap: anywhere; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(520px, 100%), 1fr)); gap: 1em; }
.plots svg, .pictures img { width: 100%; height: auto; border: 1px solid var(--line); border-radius: 6px; }
.plots svg > g > rect { fill: var(--paper); } .plots svg text { fill: var(--ink); }
.plots svg .gridline { stroke: var(--line); }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(420px, 100%), 640px)); gap: 1em; }
figure { margin: 0; } figcaption { color: var(--soft); font-size: 0.85em; }
.wide { overflow-x: auto; margin: 0.6em 0 1em; }
table { border-collapse: collapse; font-size: 0.87em; font-variant-numeric: tabular-nums; }
th, td { padding: 0.25em 0.7em; border-bottom: 1px solid var(--line); text-align: right; white-space: nowrap; }
th { background: var(--panel); vertical-align: bottom; white-space: normal; font-weight: 600; }
.text { text-align: left; } td.text:last-child { white-space: normal; min-width: 22em; } tr:hover td { background: var(--panel); }
th.sorts { cursor: pointer; } th.sorts:hover, th.sorts:focus-visible { color: var(--accent); }
th[aria-sort=ascending]::after { content: " \25b2"; } th[aria-sort=descending]::after { content: " \25bc"; }
button.save { display: block; margin: -0.6em 0 1.2em; font: inherit; font-size: 0.8em; color: var(--soft); background: none; cursor: pointer;
  border: 1px solid var(--line); border-radius: 4px; padding: 0.1em 0.6em; } button.save:hover { color: var(--accent); }
.dominated td { color: var(--soft); background: var(--panel); }
.good { color: var(--good); font-weight: bold; } .bad { color: var(--bad); font-weight: bold; }
.warn { color: var(--warn); font-weight: bold; }
.doubt { background: var(--warn-paper); padding: 0.5em 1em; border-left: 4px solid var(--warn); }
.choice { background: var(--good-paper); padding: 0.5em 1em; border-left: 4px solid var(--good); }
.fault { background: var(--bad-paper); padding: 0.5em 1em; border-left: 4px solid var(--bad); }
.verdict { font-size: 1.15em; overflow-wrap: anywhere; }
.plain { background: var(--panel); padding: 0.5em 1em; border-left: 4px solid var(--accent); white-space: pre-line; }
dl.what { display: grid; grid-template-columns: max-content 1fr; gap: 0.25em 1.2em; max-width: 80em; font-size: 0.93em; }
dl.what dt { color: var(--soft); } dl.what dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 40em) { dl.what { grid-template-columns: 1fr; } dl.what dd { margin-bottom: 0.5em; } }
@media print { button.save { display: none; } body { max-width: none; margin: 0; } }
</style>
)";
}

const char* page_script() noexcept {
  return R"(<script>
(() => {
  const text = (cell) => {
    const exact = cell?.querySelector('data');
    return exact ? exact.value : (cell?.textContent ?? '').trim();
  };
  // Numbers come first, then words, then empty cells.
  const rank = (words) => {
    if (words === '' || words === '\u2013') return [2, ''];
    const number = Number(words);
    return Number.isNaN(number) ? [1, words.toLowerCase()] : [0, number];
  };
  const compare = (a, b, sign) =>
    a[0] !== b[0] ? a[0] - b[0] : a[1] === b[1] ? 0 : a[1] < b[1] ? -sign : sign;
  const quoted = (words) => (/[",\r\n]/.test(words) ? '"' + words.replaceAll('"', '""') + '"' : words);
  document.querySelectorAll('.wide table').forEach((table, number) => {
    const [head, ...rows] = table.rows;
    if (!head || [...head.cells].some((cell) => cell.tagName !== 'TH')) return;
    [...head.cells].forEach((title, column) => {
      const sort = () => {
        const rises = title.getAttribute('aria-sort') !== 'ascending';
        for (const other of head.cells) other.removeAttribute('aria-sort');
        title.setAttribute('aria-sort', rises ? 'ascending' : 'descending');
        const ranked = rows.map((row) => [rank(text(row.cells[column])), row]);
        ranked.sort((a, b) => compare(a[0], b[0], rises ? 1 : -1));
        for (const [, row] of ranked) row.parentNode.append(row);
      };
      title.classList.add('sorts');
      title.tabIndex = 0;
      title.addEventListener('click', sort);
      title.addEventListener('keydown', (event) => {
        if (event.key === 'Enter') sort();
      });
    });
    const button = document.createElement('button');
    button.type = 'button';
    button.className = 'save';
    button.textContent = 'Save as CSV';
    button.addEventListener('click', () => {
      const lines = [...table.rows].map((row) => [...row.cells].map((cell) => quoted(text(cell))).join(','));
      const link = document.createElement('a');
      link.href = URL.createObjectURL(new Blob([lines.join('\n') + '\n'], {type: 'text/csv'}));
      link.download = (table.dataset.name || 'table_' + (number + 1)) + '.csv';
      link.click();
      URL.revokeObjectURL(link.href);
    });
    table.parentElement.after(button);
  });
})();
</script>
)";
}

}  // namespace subworld
