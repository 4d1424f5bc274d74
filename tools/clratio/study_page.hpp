// The look of the report: its head, with all the style it needs.
#pragma once

namespace tool::study {

constexpr auto page_style = R"css(
:root{--paper:#fdfcf9;--ink:#23262b;--soft:#6a6f78;--rule:#dedbd2;--wash:#f3f1ea;--accent:#8a4b17;
--r:#c8402f;--g:#3c8d40;--b:#2f68c0;--c1:#b3471d;--c2:#1f6f8b;--c3:#6b4fa0;--c4:#3c8d40;--c5:#b0882a;--good:#2d7a3a;--bad:#b3261e;--fair:#9a6a00}
@media (prefers-color-scheme:dark){:root{--paper:#17191d;--ink:#e4e2dc;--soft:#9a9ea8;--rule:#353941;--wash:#1f2228;--accent:#e0a060;
--r:#f0796a;--g:#78c67c;--b:#7fa8f0;--c1:#f0885a;--c2:#62bcd8;--c3:#b49be8;--c4:#78c67c;--c5:#dcb65a;--good:#74c980;--bad:#f28b82;--fair:#e0b050}
.wide .law,.wide .dots{filter:brightness(1.7)}}
*{box-sizing:border-box}
html{background:var(--paper);color:var(--ink);font:17px/1.58 Charter,"Bitstream Charter","Sitka Text",Cambria,Georgia,serif}
body{max-width:74rem;margin:0 auto;padding:2.5rem 1.5rem 5rem}
p,ul,ol,h1,h2,h3,.prose{max-width:44rem}
h1{font-size:2.35rem;line-height:1.15;margin:0 0 .4rem;font-weight:600;letter-spacing:-.01em}
h2{font-size:1.5rem;margin:3.6rem 0 .7rem;font-weight:600;border-top:1px solid var(--rule);padding-top:1.1rem;max-width:none}
h3{font-size:1.12rem;margin:2rem 0 .4rem;font-weight:600}
.lead{font-size:1.12rem;color:var(--soft);margin:0 0 1.6rem}
a{color:var(--accent);text-decoration-thickness:1px;text-underline-offset:2px}
nav{font-size:.92rem;margin:1.2rem 0 0;max-width:none}nav a{margin-right:1.1rem;white-space:nowrap}
small,figcaption,.note,table,summary,.tick,.label{font-family:"Helvetica Neue",Inter,"Segoe UI",Roboto,Arial,sans-serif}
figure{margin:1.2rem 0}figcaption,.note{font-size:.83rem;line-height:1.45;color:var(--soft);max-width:48rem}
.shots{display:grid;grid-template-columns:repeat(4,1fr);gap:.6rem}.shots img{width:100%;display:block;border-radius:3px;background:#000}
.shots figure{margin:0}.shots figcaption{padding-top:.3rem}
@media (max-width:46rem){.shots{grid-template-columns:repeat(2,1fr)}}
.scroll{overflow-x:auto}
table{border-collapse:collapse;font-size:.83rem;font-variant-numeric:tabular-nums}
th{font-weight:600;text-align:left;color:var(--soft)}td,th{padding:.28rem .55rem;vertical-align:top}
.numbers td,.numbers th{border-bottom:1px solid var(--rule)}.numbers td+td,.numbers th+th{text-align:right}
.findings td{border-bottom:1px solid var(--rule)}.findings td:nth-child(3){white-space:nowrap}
.densities{width:100%;table-layout:fixed;min-width:58rem}.densities th:first-child{width:11.5rem}
.densities td{padding:1px 3px 6px}.densities th{padding:.3rem .2rem;vertical-align:middle;line-height:1.3}
.densities thead th{text-align:center;border-bottom:1px solid var(--rule)}.densities th span{font-weight:400;display:block}
.densities td div{font-size:.7rem;color:var(--soft);text-align:center;line-height:1.2}
.cell{width:100%;height:7.2rem;background:var(--wash);border-radius:2px;display:block}
.cell path{vector-effect:non-scaling-stroke;fill-opacity:.13;stroke-width:1.1;stroke-opacity:.9}
.cell .r{stroke:var(--r);fill:var(--r)}.cell .g{stroke:var(--g);fill:var(--g)}.cell .b{stroke:var(--b);fill:var(--b)}
.cell .zero{stroke:var(--soft);stroke-width:.6;stroke-dasharray:2 3;fill:none}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(26rem,1fr));gap:1.2rem 1.6rem}.plots figure{margin:0}
svg text{fill:var(--ink);font-family:"Helvetica Neue",Inter,"Segoe UI",Roboto,Arial,sans-serif}
.tick{font-size:11px;fill:var(--soft)!important}.label{font-size:11.5px;fill:var(--soft)!important}.heading{font-size:14px;font-weight:600}
.middle{text-anchor:middle}.end{text-anchor:end}
.plot,.wide{width:100%;display:block}.grid{stroke:var(--rule);stroke-width:.7;fill:none}
.guide{stroke:var(--soft);stroke-width:1;stroke-dasharray:1 4;fill:none}
.curve{fill:none;stroke-width:1.6}.curve.plain{stroke-dasharray:6 4}.mark{stroke-width:1.3}
.c1{stroke:var(--c1)}.c2{stroke:var(--c2)}.c3{stroke:var(--c3)}.c4{stroke:var(--c4)}.c5{stroke:var(--c5)}
.mark.c1{fill:var(--c1)}.mark.c2{fill:var(--c2)}.mark.c3{fill:var(--c3)}.mark.c4{fill:var(--c4)}.mark.c5{fill:var(--c5)}
.mark.plain{fill:var(--paper)}
.law{fill:none;stroke-width:1.3}.law.dashed{stroke-dasharray:7 4;stroke-width:1}.dots{fill:none;stroke-width:2.6;stroke-linecap:round}
.key{display:flex;flex-wrap:wrap;gap:.3rem 1.3rem;font:.83rem "Helvetica Neue",Inter,Arial,sans-serif;margin:.4rem 0 1rem}
.key svg{width:2.2rem;height:.8rem;vertical-align:middle;margin-right:.35rem}
.verdict{font-weight:600;white-space:nowrap}.holds{color:var(--good)}.fails{color:var(--bad)}.weakly,.undecided{color:var(--fair)}
blockquote{margin:.6rem 0;padding:0 0 0 1rem;border-left:3px solid var(--rule);font-style:italic;max-width:43rem}
details{margin:1rem 0}summary{cursor:pointer;color:var(--accent);font-size:.9rem}
code{font:.86em ui-monospace,"SF Mono",Menlo,Consolas,monospace;background:var(--wash);padding:.08em .3em;border-radius:3px}
)css";

}  // namespace tool::study
