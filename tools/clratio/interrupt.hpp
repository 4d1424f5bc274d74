// Ctrl-C, and a polite kill, as a question that long work asks itself now and then.
#pragma once

#include <csignal>

namespace tool {

/// While one of these lives, the first SIGINT or SIGTERM only makes asked() true; a second one ends the process as usual.
class Interrupt {
public:
    Interrupt();
    ~Interrupt();
    Interrupt(const Interrupt&) = delete;
    Interrupt& operator=(const Interrupt&) = delete;

    bool asked() const;

private:
    struct sigaction before_int_ {
    }, before_term_{};
};

}  // namespace tool
