// One line on stderr that says how far the work is; nothing where stderr is no terminal.
#pragma once

#include <cstdint>
#include <string>

namespace tool {

class ProgressLine {
public:
    ProgressLine();
    ~ProgressLine() { clear(); }
    ProgressLine(const ProgressLine&) = delete;
    ProgressLine& operator=(const ProgressLine&) = delete;

    void show(const std::string& text);
    void clear();  ///< leaves the line empty, for what is printed next

private:
    bool terminal_, shown_ = false;
};

}  // namespace tool
