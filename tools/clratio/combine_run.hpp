// One run of clratio combine: sums on the device, the state they are kept in, and the images that are read out.
#pragma once

#include "clratio/engine.hpp"
#include "combine_report.hpp"
#include "combine_state.hpp"

namespace tool::combining {

class CombineRun {
public:
    explicit CombineRun(const Options& options);

    bool holds(std::uint64_t index) const { return keeper_.ranges().contains(index); }
    std::uint64_t batches() const { return keeper_.ranges().count(); }

    /// Throws where the images are not like those before, or, being the first, not like tau and the reference.
    void fit(const Pair& pair);
    bool is_begun() const { return !keeper_.shape().channels.empty(); }
    /// Adds to the sums; saves them where --checkpoint says so.
    void add(const std::vector<Pair>& pairs);
    /// Where these are all there will ever be, no state is kept, and no sums are needed.
    void read_out_at_once(const std::vector<Pair>& pairs);
    bool needs_sums() const { return sums_.fixed || sums_.moments.groups > 1; }
    /// Saves what was added since the last time; nothing where the device failed in the middle of adding.
    void save();
    /// save() after `work`, however it ends.
    template <class Work> void saved_at_the_end(Work work) {
        try {
            work();
        } catch (const clratio::IoError& e) {
            save();
            if (batches() == 0) throw;
            throw clratio::IoError(e.path, e.layer, e.reason + "; " + what_is_held());
        } catch (...) {
            save();
            throw;
        }
        save();
    }
    std::string how_to_go_on() const;

    /// Reads out what was added and writes the images.
    void read_out();
    /// Root mean square of the standard errors read out last, over the values that have one; +inf where none has.
    double rms_error() const { return rms_error_; }

    /// Prints, and gives the exit code. `decode`: seconds spent reading images elsewhere.
    int report(double decode);

private:
    std::string what_is_held() const;
    void fit_tau();
    /// Those before the first that does not fit, and why it does not.
    struct Accepted {
        std::vector<clratio::HostBatch> batches;
        std::exception_ptr misfit;
    };
    void require_fit(const Pair& pair);
    Accepted accept(const std::vector<Pair>& pairs);
    void write(ReadOut&& read_out);

    const Options& options_;
    TauInput tau_;
    SideReader reference_file_;
    Report report_;
    StateKeeper keeper_;
    clratio::Engine engine_;
    std::optional<Bands> bands_;
    Sums sums_;
    clratio::Image reference_;
    bool whole_ = true;  ///< all bands hold the same batches
    double rms_error_ = 0;
};

}  // namespace tool::combining
