// Misuse must be refused, by the name that the message holds.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "clratio/exception.hpp"

namespace clratio::test {

template <class Call> void refused(Call&& call, const std::string& what) {
    try {
        call();
        ADD_FAILURE() << "accepted: " << what;
    } catch (const InvalidArgument& e) {
        EXPECT_NE(std::string(e.what()).find(what), std::string::npos) << e.what();
    }
}

}  // namespace clratio::test
