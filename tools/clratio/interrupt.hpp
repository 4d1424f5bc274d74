// Ctrl-C as a question that long work asks itself now and then.
#pragma once

#include <csignal>

namespace tool {

/// While one of these lives, the first SIGINT only makes asked() true; a second one ends the process as usual.
class Interrupt {
public:
    Interrupt();
    ~Interrupt();
    Interrupt(const Interrupt&) = delete;
    Interrupt& operator=(const Interrupt&) = delete;

    bool asked() const;

private:
    struct sigaction before_ {};
};

}  // namespace tool
