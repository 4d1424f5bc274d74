// OpenEXR's way to a WholeFile; private to clratio::io.
#pragma once

#include <ImfIO.h>

#include "whole_file.hpp"

namespace clratio {

/// OpenEXR 3.1 writes its offset table in a destructor that swallows a failure: the file remembers it.
class ExrStream : public Imf::OStream {
public:
    explicit ExrStream(const std::filesystem::path& target) : Imf::OStream(target.c_str()), file_(target) {}

    void write(const char bytes[], int size) override {
        const auto count = static_cast<std::size_t>(size);
        file_.write({bytes, count}, position_);
        position_ += count;
    }
    std::uint64_t tellp() override { return position_; }
    void seekp(std::uint64_t position) override { position_ = position; }

    WholeFile& file() { return file_; }

private:
    WholeFile file_;
    std::uint64_t position_ = 0;
};

}  // namespace clratio
