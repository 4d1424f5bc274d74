// An Engine at namespace scope, used before main: what it built is kept when the program ends.
#include <clratio/clratio.hpp>

namespace {

const clratio::Engine engine;
const bool same_bits = engine.self_test();

}  // namespace

int main() { return same_bits ? 0 : 1; }
