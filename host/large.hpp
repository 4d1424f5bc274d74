// Memory of large results. Private to the library.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace clratio {

inline constexpr std::size_t huge_page = std::size_t{2} << 20;

/// v.resize(count), its values lost where it grows. Whoever touches fresh memory first waits for each of its pages: a large
/// vector asks for huge ones.
template <class T> void resize_large(std::vector<T>& v, std::size_t count) {
#ifdef MADV_HUGEPAGE
    if (count > v.capacity() && count * sizeof(T) >= 2 * huge_page) {
        v = {};
        v.reserve(count);
        const auto begin = reinterpret_cast<std::uintptr_t>(v.data());
        const std::uintptr_t first = (begin + huge_page - 1) / huge_page * huge_page;
        madvise(reinterpret_cast<void*>(first), (begin + count * sizeof(T) - first) / huge_page * huge_page, MADV_HUGEPAGE);
    }
#endif
    v.resize(count);
}

}  // namespace clratio
