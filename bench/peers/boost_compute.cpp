#include "boost_compute.hpp"

#include <boost/compute/command_queue.hpp>
#include <boost/compute/container/vector.hpp>
#include <boost/compute/random/default_random_engine.hpp>
#include <boost/compute/random/normal_distribution.hpp>
#include <memory>

namespace peers {
namespace {

namespace compute = boost::compute;

struct Normals {
    Normals(const clratio::Engine& engine, std::uint64_t count)
        : queue(engine.queue()), generator(queue, 1), out(count, queue.get_context()) {}
    void fill() {
        normal.generate(out.begin(), out.end(), generator, queue);
        queue.finish();
    }
    compute::command_queue queue;
    compute::default_random_engine generator;
    compute::normal_distribution<float> normal{0, 1};
    compute::vector<float> out;
};

}  // namespace

std::function<void()> boost_normals(const clratio::Engine& engine, std::uint64_t count) {
    return [normals = std::make_shared<Normals>(engine, count)] { normals->fill(); };
}

}  // namespace peers
