// The command line. A subcommand is one file with one add_ function; it is registered here.
#include <CLI/CLI.hpp>

#include <csignal>
#include <cstdio>
#include <thread>

#include "clratio/exception.hpp"
#include "clratio/image.hpp"
#include "tool.hpp"

namespace {

constexpr auto footer = R"(Exit codes:
  0  done
  1  failed: a file, a device (one line on stderr names it)
  2  usage: the arguments do not parse or do not fit together
  3  done, but values were flagged and --fail-on-flag was given
  130  stopped by Ctrl-C or SIGTERM

Examples:
  clratio devices
  clratio combine --m m_*.exr --t t_*.exr --tau tau.exr -o out.exr
  clratio merge node1.exr node2.exr -o all.exr
  clratio compare out.exr reference.exr

The environment variable CLRATIO_DEVICE ("0:0", "cpu", "gpu", or a part of a name) chooses the device.)";

constexpr auto add_commands = {tool::add_devices,    tool::add_combine, tool::add_merge,  tool::add_compare,
                               tool::add_picture,    tool::add_law,     tool::add_errors, tool::add_figures,
                               tool::add_estimators, tool::add_audit,   tool::add_render, tool::add_study};

int fail(const std::string& what, int code) {
    std::fputs(("clratio: " + what + "\n").c_str(), stderr);  // fmt::print would throw where nothing can be written
    return code;
}

int run_command(int argc, char** argv) {
    CLI::App app{"clratio: ratio estimators on OpenCL"};
    app.name("clratio");
    app.set_version_flag("--version", std::string("clratio ") + CLRATIO_VERSION);
    app.require_subcommand(0, 1);
    app.footer(footer);
    tool::Run run;
    for (const auto add : add_commands) add(app, run);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        if (e.get_exit_code() == 0) return app.exit(e);
        const auto called = app.get_subcommands();
        const std::string help = called.empty() ? "clratio --help" : "clratio " + called.front()->get_name() + " --help";
        return fail(std::string(e.what()) + " (see " + help + ")", tool::usage);
    }
    if (!run) return fail("a subcommand is needed: devices, combine, ... (see clratio --help)", tool::usage);
    clratio::set_image_threads(std::thread::hardware_concurrency());
    try {
        return run();
    } catch (const tool::UsageError& e) {
        return fail(e.what(), tool::usage);
    } catch (const tool::Stopped& e) {
        return fail(e.what(), tool::interrupted);
    } catch (const clratio::Cancelled& e) {
        return fail(e.what(), tool::interrupted);
    } catch (const std::exception& e) {
        return fail(e.what(), tool::failed);
    }
}

}  // namespace

int main(int argc, char** argv) {
    std::signal(SIGXFSZ, SIG_IGN);  // a file-size limit is an error of the write, not the end of the process
    const int code = run_command(argc, argv);
    if (std::fflush(stdout) != 0 || std::ferror(stdout)) return fail("standard output cannot be written", tool::failed);
    return code;
}
