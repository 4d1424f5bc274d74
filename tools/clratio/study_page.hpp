// The report's style and its sentences; {} are numbers of the run.
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
nav{font-size:.92rem;margin:1.2rem 0 0;display:flex;flex-wrap:wrap;gap:.2rem 1.1rem}nav a{white-space:nowrap}
small,figcaption,.note,table,summary,.tick,.label{font-family:"Helvetica Neue",Inter,"Segoe UI",Roboto,Arial,sans-serif}
figure{margin:1.2rem 0}figcaption,.note{font-size:.83rem;line-height:1.45;color:var(--soft);max-width:48rem}
.shots{display:grid;grid-template-columns:repeat(4,1fr);gap:.6rem}.shots img{width:100%;display:block;border-radius:3px;background:#000}
.shots figure{margin:0}.shots figcaption{padding-top:.3rem}
@media (max-width:46rem){.shots{grid-template-columns:repeat(2,1fr)}}
.scroll{overflow-x:auto}
table{border-collapse:collapse;font-size:.83rem;font-variant-numeric:tabular-nums}
th{font-weight:600;text-align:left;color:var(--soft)}td,th{padding:.28rem .55rem;vertical-align:top}
.whisker{stroke-width:1}.twofold small{display:block;color:var(--soft);font-size:.72rem;line-height:1.2}.twofold .pair{border-left:1px solid var(--rule)}
.total td{font-weight:600;border-bottom:0}
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

constexpr auto page_introduction = R"html(<h1>Fog, shadows and ratio estimators</h1>
<p class="lead">How fast do renderings of light scattered once in fog converge, and does dividing out the unshadowed noise
help? Measured against exact answers.</p>
<p>A camera looks into a box of fog. Sunlight enters, is scattered once and reaches the camera, unless a slat, a wall or a ball
is in its way. Along each camera ray the renderer takes a few random points; <i>m</i> is the mean of the light from them with
the shadows, <i>t</i> the mean without. The exact unshadowed light <i>τ</i> is known in closed form, and so the shadowed light
can be estimated in two ways:</p>
<p style="text-align:center"><i>plain mean</i>: m &emsp;&emsp; <i>ratio</i>: τ · m / t</p>
<p>The ratio divides out what is noise in the fog and leaves what is noise in the shadow. In these scenes the shadowed light is
known exactly, too: every error below is the true error of a pixel’s colour, not a difference from another noisy picture.</p>
)html";

constexpr auto page_run =
    R"html(<p>This run rendered {} images of {} × {} pixels for each of {} estimators in {} scenes, with
N = 1, 2, 4, .. 64 samples a pixel.{}</p>
)html";

constexpr auto page_contents = R"html(</ul>
<nav><a href="#scenes">Scenes</a><a href="#claims">Claims</a><a href="#convergence">Convergence</a><a href="#tables">Error
densities (Tables 1–4)</a><a href="#chords">Short chords</a><a href="#averages">Averaged ratios</a><a
href="#figures">Error laws (Figures 1, 2)</a><a href="#audit">The equations</a><a href="#speed">Speed</a><a
href="#colophon">How it was made</a></nav>
)html";

constexpr auto page_scenes = R"html(<h2 id="scenes">The scenes</h2>
<p>One ray through the middle of each pixel, light scattered once. The third picture is what a renderer gives after four
samples (WVDS, MIS), the fourth is made of the same numbers.</p>
)html";

constexpr auto page_scene = R"html(<p class="note">{} of {} rays meet the fog; {:.0f} % of these are fully lit. Extinction
{:g}, {:g}, {:g}; scattering {:g}, {:g}, {:g}; g {:g}. Spheres: {}, boxes: {}. Name: <code>{}</code></p>
)html";

constexpr auto page_claims = R"html(<h2 id="claims">Four claims, and what became of them</h2>
<p>The supplement draws four conclusions from its tables. Here each is decided by the numbers of this run; two errors differ
where they are 4 standard errors apart. <i>WVDS</i> draws distances by the fog toward both the light and the camera;
<i>distance sampling</i> by the fog toward the camera alone: on an endless ray (untruncated) or within the box (truncated).</p>
)html";

constexpr auto page_convergence = R"html(<h2 id="convergence">Error against samples</h2>
<p>Root mean squared error over all pixels whose rays meet the fog, all channels and images. Marks are measured. For
independent samples the lines are not drawn through them: they are predicted from exact second moments, for the plain mean
exactly, for the ratio to first order in 1/N. For ray marching, a grid with jitter, lines only join the marks.</p>
<div class="key">)html";

constexpr auto page_numbers = R"html(</div>
<details><summary>The numbers: RMSE × 1000 of all estimators, and what the second moments predict at N = 64</summary>
)html";

constexpr auto page_numbers_end =
    R"html(<p class="note">Two standard errors in the tooltip: from the spread of the images, whose channels and pixels are
summed first, for this grid of pixels; and with pixels as clusters, for any other grid, too. Values with heavy tails
(independent t, WVDS mean in a dense medium) have no stable RMSE: the median size of an error is given in
errors.csv. An error counts as at most 64 to 128 ranges; where that makes a plain mean's number too small by four standard
errors, the exact one stands behind it in brackets.</p></details>
)html";

constexpr auto page_tables = R"html(<h2 id="tables">Densities of the error</h2>
<p>Laid out as the supplement’s Tables 1 to 4: a row for each estimator, a column for each N. In each cell the error of red,
green and blue goes upwards: above the dotted line a pixel is brighter than it should be, below it darker. To the right goes
the density, as its square root, so that the flanks can be seen beside the peak. Each cell is drawn to its own peak: look at
the shape and the spread; the number below is the RMSE × 1000. Pixels whose error is 0 are left out.</p>
<p>The lobes of the ratio are no accident: with k of N samples in shadow the estimate is about τ(1 − k/N), so the errors of one
pixel sit on a ladder of N + 1 rungs.</p>
)html";

constexpr auto page_chords = R"html(<h2 id="chords">Where rays only touch the fog</h2>
<p>At the corners and edges of the box a ray is in the fog for a short way only. A distance drawn on an endless ray lies behind
it then nearly always, and the rare one that does not must carry all of the light. The table has the root mean square of
error / τ at N = {} in the shortest tenth of the chords; {} images.</p>
<div class="scroll"><table class="numbers twofold"><tr><th><th>up to)html";

constexpr auto page_chords_end = R"html(</table></div>
<p class="note">“Up to”: the longest of these chords, as a share of the scene’s longest. In grey what the second moments say of
the plain mean, exactly. Where the two differ by much the tail is heavy: a few samples make up the mean square, and a run meets
some of them or none. One standard error in the tooltip. All numbers: short_chords.csv.</p>
)html";

constexpr auto page_averages = R"html(<h2 id="averages">Divide last</h2>
<p>Who has a picture of τ · m / t for each sample, or for each frame of an animation, may be tempted to average these. But the
mean of ratios is another estimate than the ratio of means: each ratio keeps the bias of the few samples it was made of, however
many are averaged. Here single samples are divided at once and averaged (<i>mean of ratios</i>), or summed and divided once
(<i>ratio of means</i>); the same samples for both, {} images of {} × {} pixels.</p>
<p>{}</p>
<div class="key">)html";

constexpr auto page_averages_end =
    R"html(<p class="note">Bias × 1000 against samples a pixel; bars are one standard error. All
numbers, with RMSE: averages.csv.</p>
<details><summary>The numbers</summary><div class="scroll"><table class="numbers"><tr><th><th>samples<th>estimate<th>bias × 1000, N =
1<th>N = 4<th>N = 64<th>RMSE × 1000, N = 1<th>N = 4<th>N = 64</tr>
)html";

constexpr auto page_speed = R"html(<h2 id="speed">How fast</h2>
<p>Million samples a second on {}: rays set up, samples drawn, shadows looked up, and errors of N = 1, 2, 4, .. 64 with and
without the ratio compared and counted on the way.</p>
<div class="scroll"><table class="numbers"><tr><th>)html";

constexpr auto page_speed_end = R"html(</table></div>
<p class="note">Rates are those of the middle part of each, so that a machine that does other work for a while does not
blur them; seconds are sums. Rays that miss the fog are not counted. Patterns are drawn anew for each N, 127 samples a pixel
instead of 64. “–”: no part of it was timed. Times are those of the parts computed in this folder on this device, now or in an
earlier run ({} of {} parts); parts from other folders or machines count in the errors, but not here. Standard errors clustered by pixel took {:.1f} s more, predictions, lit pixels,
short chords and averages {:.1f} s.</p>
)html";

constexpr auto page_figures = R"html(<h2 id="figures">The law of the error</h2>
<p>Apart from scenes: if the means of m and t are normal, the law of the ratio’s error is known. Figure 1 has the exact laws
for μ = 0.5, τ = 1, σ<sub>m</sub> = 0.5, σ<sub>t</sub> = 0.35 and independent m and t; dashes are eq. (22) as the supplement
prints it, which lacks a factor. Figure 2 has {} sampled errors of each beside them.</p>
<figure>{}<figcaption>Figure 1. Laws.</figcaption></figure>
<figure>{}<figcaption>Figure 2. Samples.</figcaption></figure>
)html";

constexpr auto page_end = R"html(</table>
<p class="note">Errors are counted on the device as whole numbers, so that errors.csv and densities.csv have the same bytes
however the work is split, stopped and merged. The method is that of supplemental material IV of Velinov and Mitchell’s paper,
doi 10.1109/TVCG.2021.3135764; scenes and numbers are this project’s own, and only the shape of the supplement’s tables can be
compared.</p>
</html>
)html";

}  // namespace tool::study
