#include "clratio/image.hpp"

#include <ImfStringAttribute.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <set>

#include "exr_stream.hpp"
#include "support/exr.hpp"
#include "support/limited.hpp"
#include "support/scratch.hpp"

using namespace clratio;
using clratio::test::Ended;
using clratio::test::ExrPart;
using clratio::test::limited;

namespace {

const std::vector<Imf::Compression> compressions{
    Imf::NO_COMPRESSION,    Imf::RLE_COMPRESSION, Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION,  Imf::PIZ_COMPRESSION,
    Imf::PXR24_COMPRESSION, Imf::B44_COMPRESSION, Imf::B44A_COMPRESSION, Imf::DWAA_COMPRESSION, Imf::DWAB_COMPRESSION};

// PXR24 cuts floats to 24 bits, B44 compresses half, DWA whatever is called R, G or B and is not uint.
bool lossless(Imf::Compression c, Imf::PixelType type) {
    if (c <= Imf::PIZ_COMPRESSION || type == Imf::UINT) return true;
    if (c == Imf::PXR24_COMPRESSION) return type == Imf::HALF;
    return (c == Imf::B44_COMPRESSION || c == Imf::B44A_COMPRESSION) && type == Imf::FLOAT;
}

std::vector<float> channel_of(const Image& image, const std::string& name) {
    std::vector<float> plane;
    for (std::size_t c = 0; c < image.channels.size(); ++c)
        if (image.channels[c] == name)
            for (std::size_t i = c; i < image.values.size(); i += image.channels.size()) plane.push_back(image.values[i]);
    return plane;
}

std::vector<float> exact_plane(const ExrPart& part, std::size_t c) {
    std::vector<float> plane;
    for (int y = 0; y < part.height(); ++y)
        for (int x = 0; x < part.width(); ++x) plane.push_back(clratio::test::exact_value(c, x, y));
    return plane;
}

void expect_as_openexr_reads(const std::string& path, const ExrPart& part) {
    const Image image = read_image(path);
    EXPECT_EQ(image.channels, (std::vector<std::string>{"R", "G", "B"}));
    EXPECT_EQ(image.data_window, (Window{part.data.min.x, part.data.min.y, part.data.max.x, part.data.max.y}));
    EXPECT_EQ(image.display_window,
              (Window{part.display.min.x, part.display.min.y, part.display.max.x, part.display.max.y}));
    EXPECT_TRUE(image.alpha.empty());
    for (std::size_t c = 0; c < part.channels.size(); ++c) {
        EXPECT_EQ(channel_of(image, part.channels[c]), clratio::test::read_channel(path, 0, part.channels[c]));
        if (lossless(part.compression, part.type)) {
            EXPECT_EQ(channel_of(image, part.channels[c]), exact_plane(part, c));
        }
    }
}

/// What reading throws; fails the test where it does not.
IoError refusal(const std::string& spec, const std::string& layer = "") {
    try {
        read_image(spec, layer);
    } catch (const IoError& e) {
        return e;
    }
    ADD_FAILURE() << spec << " was read";
    return {"", "", ""};
}

void expect_in(const std::string& part, const std::string& text) {
    EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is not in: " << text;
}

Image small_image() {
    Image image;
    image.channels = {"R", "G", "B"};
    image.data_window = {-3, 2, 5, 8};
    image.display_window = {0, 0, 19, 9};
    for (int i = 0; i < 9 * 7 * 3; ++i) image.values.push_back(std::sin(static_cast<float>(i)));
    return image;
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), 4 * a.size()) == 0;
}

}  // namespace

TEST(Image, reads_every_compression_and_pixel_type_as_openexr_does) {
    const clratio::test::Scratch scratch;
    for (const auto compression : compressions)
        for (const auto type : {Imf::HALF, Imf::FLOAT, Imf::UINT})
            for (const int tile : {0, 16}) {
                SCOPED_TRACE(testing::Message() << "compression " << compression << " type " << type << " tile " << tile);
                const ExrPart part{.type = type, .compression = compression, .tile = tile};
                clratio::test::write_exr(scratch / "a.exr", {part});
                expect_as_openexr_reads(scratch / "a.exr", part);
            }
}

TEST(Image, the_comparison_sees_a_lossy_compression) {
    const clratio::test::Scratch scratch;
    const ExrPart part{.type = Imf::FLOAT, .compression = Imf::DWAA_COMPRESSION};
    clratio::test::write_exr(scratch / "a.exr", {part});
    EXPECT_NE(channel_of(read_image(scratch / "a.exr"), "R"), exact_plane(part, 2));
}

TEST(Image, reads_level_0_of_mipmaps_and_ripmaps) {
    const clratio::test::Scratch scratch;
    for (const auto levels : {Imf::MIPMAP_LEVELS, Imf::RIPMAP_LEVELS}) {
        const ExrPart part{.type = Imf::HALF, .tile = 8, .levels = levels};
        clratio::test::write_exr(scratch / "a.exr", {part});
        expect_as_openexr_reads(scratch / "a.exr", part);
    }
}

TEST(Image, reads_a_data_window_that_is_not_the_display_window) {
    const clratio::test::Scratch scratch;
    for (const int tile : {0, 8}) {
        const ExrPart part{.data = {{-7, 11}, {20, 40}}, .display = {{0, 0}, {99, 49}}, .tile = tile};
        clratio::test::write_exr(scratch / "a.exr", {part});
        expect_as_openexr_reads(scratch / "a.exr", part);
    }
}

TEST(Image, finds_parts_by_name) {
    const clratio::test::Scratch scratch;
    const ExrPart beauty{.type = Imf::HALF, .name = "beauty"};
    const ExrPart depth{.channels = {"Z"}, .name = "depth"};
    const ExrPart tiled{
        .channels = {"light.B", "light.G", "light.R"}, .data = {{5, 5}, {30, 20}}, .tile = 16, .name = "more"};
    clratio::test::write_exr(scratch / "a.exr", {beauty, depth, tiled});
    EXPECT_EQ(channel_of(read_image(scratch / "a.exr"), "G"), exact_plane(beauty, 1)) << "the unnamed colour";
    EXPECT_EQ(channel_of(read_image(scratch / "a.exr:beauty"), "R"), exact_plane(beauty, 2));
    EXPECT_EQ(channel_of(read_image(scratch / "a.exr", "depth"), "Z"), exact_plane(depth, 0));
    EXPECT_EQ(channel_of(read_image(scratch / "a.exr:light"), "R"), exact_plane(tiled, 2));
    EXPECT_EQ(channel_of(read_image(scratch / "a.exr:more.light"), "B"), exact_plane(tiled, 0));
    EXPECT_EQ(read_image(scratch / "a.exr:light").data_window, (Window{5, 5, 30, 20}));

    clratio::test::write_exr(scratch / "b.exr", {beauty, ExrPart{.name = "second"}});
    expect_in("beauty, second", refusal(scratch / "b.exr").what());
}

TEST(Image, finds_layers) {
    const clratio::test::Scratch scratch;
    const std::string path = scratch / "a.exr";
    const ExrPart one{.channels = {"View.Combined.A", "View.Combined.B", "View.Combined.G", "View.Combined.R",
                                   "View.Depth.Z", "View.Normal.X", "View.Normal.Y", "View.Normal.Z"}};
    clratio::test::write_exr(path, {one});
    const Image image = read_image(path);
    EXPECT_EQ(image.layer, "View.Combined");
    EXPECT_EQ(image.channels, (std::vector<std::string>{"R", "G", "B"}));
    EXPECT_EQ(image.alpha, exact_plane(one, 0));
    EXPECT_EQ(channel_of(image, "B"), exact_plane(one, 1));
    EXPECT_EQ(read_image(path, "View.Normal").channels, (std::vector<std::string>{"X", "Y", "Z"}));
    EXPECT_EQ(read_image(path + ":View.Depth", "View.Normal").channels, std::vector<std::string>{"Z"})
        << "the file's own wins";
    expect_in("the file has View.Combined, View.Depth (not a colour)", refusal(path, "View").what());
    expect_in(path + ":View", refusal(path, "View").what());

    clratio::test::write_exr(path, {{.channels = {"a.B", "a.G", "a.R", "b.B", "b.G", "b.R"}}});
    expect_in("several layers and none named (FILE:LAYER, or --layer): a, b", refusal(path).what());
    clratio::test::write_exr(path, {{.channels = {"B", "G", "R", "b.B", "b.G", "b.R"}}});
    EXPECT_EQ(read_image(path).layer, "");
    clratio::test::write_exr(path, {{.channels = {"A", "Y"}}});
    EXPECT_EQ(read_image(path).channels, std::vector<std::string>{"Y"});
    EXPECT_EQ(read_image(path).alpha.size(), 37u * 23u);
    clratio::test::write_exr(path, {{.channels = {"A"}}});
    EXPECT_EQ(read_image(path).channels, std::vector<std::string>{"A"});
    clratio::test::write_exr(path, {{.channels = {"u.U", "v.V"}}});
    expect_in("several layers", refusal(path).what());
}

TEST(Image, reads_a_file_with_a_colon_in_its_name) {
    const clratio::test::Scratch scratch;
    clratio::test::write_exr(scratch / "take:2.exr", {ExrPart{}});
    EXPECT_EQ(read_image(scratch / "take:2.exr").path, scratch / "take:2.exr");
}

TEST(Image, reads_what_blender_writes) {
    const std::string folder = CLRATIO_TEST_DATA "/cycles/multilayer/";
    const Image image = read_image(folder + "m_000.exr");
    EXPECT_EQ(image.layer, "ViewLayer.Combined");
    EXPECT_EQ(image.width(), 161);
    EXPECT_EQ(image.height(), 107);
    EXPECT_EQ(image.alpha.size(), 161u * 107u);
    EXPECT_EQ(channel_of(image, "G"), clratio::test::read_channel(folder + "m_000.exr", 0, "ViewLayer.Combined.G"));
}

TEST(Image, refuses_what_it_cannot_read_by_name) {
    const clratio::test::Scratch scratch;
    expect_in(scratch / "none.exr" + ": no such file", refusal(scratch / "none.exr").what());
    expect_in("is a folder", refusal(scratch / "").what());
    clratio::test::put_bytes(scratch / "text.exr", "not an image");
    expect_in("text.exr: cannot be opened, or is not an OpenEXR file", refusal(scratch / "text.exr").what());
    clratio::test::put_bytes(scratch / "empty.exr", "");
    expect_in("empty.exr", refusal(scratch / "empty.exr").what());
    clratio::test::write_deep_exr(scratch / "deep.exr");
    expect_in("deep.exr: deep images", refusal(scratch / "deep.exr").what());
    clratio::test::write_exr(scratch / "sub.exr",
                             {{.data = {{0, 0}, {31, 31}}, .display = {{0, 0}, {31, 31}}, .sampling = 2}});
    expect_in("sub.exr: channel B is subsampled", refusal(scratch / "sub.exr").what());
}

TEST(Image, refuses_a_file_whose_writer_stopped) {
    const clratio::test::Scratch scratch;
    const ExrPart part{.compression = Imf::NO_COMPRESSION};
    {
        const auto header = clratio::test::header_of(part);
        Imf::MultiPartOutputFile file((scratch / "a.exr").c_str(), &header, 1);
        std::vector<std::vector<char>> planes;
        for (std::size_t c = 0; c < 3; ++c) planes.push_back(clratio::test::plane_of(part, c));
        Imf::OutputPart out(file, 0);
        out.setFrameBuffer(clratio::test::frame_of(part, planes));
        out.writePixels(part.height() - 1);
    }
    expect_in("incomplete: pixels are missing", refusal(scratch / "a.exr").what());
}

TEST(Image, refuses_every_truncated_file) {
    const clratio::test::Scratch scratch;
    for (const auto compression : compressions)
        for (const int tile : {0, 16}) {
            clratio::test::write_exr(scratch / "a.exr", {{.type = Imf::HALF, .compression = compression, .tile = tile}});
            const std::string whole = clratio::test::bytes_of(scratch / "a.exr");
            const std::size_t step = compression == Imf::ZIP_COMPRESSION ? 1 : 61;
            for (std::size_t size = 0; size < whole.size(); size += step) {
                clratio::test::put_bytes(scratch / "cut.exr", whole.substr(0, size));
                EXPECT_THROW(read_image(scratch / "cut.exr"), IoError)
                    << size << " of " << whole.size() << " bytes, " << compression;
            }
        }
}

TEST(Image, a_flipped_byte_of_a_checksummed_file_is_an_error_or_changes_nothing) {
    const clratio::test::Scratch scratch;
    for (const auto compression : {Imf::ZIP_COMPRESSION, Imf::ZIPS_COMPRESSION, Imf::PXR24_COMPRESSION}) {
        clratio::test::write_exr(scratch / "a.exr", {{.type = Imf::HALF, .compression = compression}});
        const std::string whole = clratio::test::bytes_of(scratch / "a.exr");
        const Image right = read_image(scratch / "a.exr");
        int refused = 0;
        for (std::size_t at = clratio::test::header_end(whole); at < whole.size(); ++at) {
            std::string damaged = whole;
            damaged[at] = static_cast<char>(damaged[at] ^ (1 << at % 8));
            clratio::test::put_bytes(scratch / "b.exr", damaged);
            try {
                EXPECT_TRUE(same_bits(read_image(scratch / "b.exr").values, right.values))
                    << "byte " << at << ", " << compression;
            } catch (const IoError&) {
                ++refused;
            }
        }
        EXPECT_GT(refused, 100);
    }
}

TEST(Image, a_flipped_byte_anywhere_never_crashes) {
    const clratio::test::Scratch scratch;
    for (const auto compression : compressions)
        for (const int tile : {0, 16}) {
            clratio::test::write_exr(scratch / "a.exr", {{.type = Imf::HALF, .compression = compression, .tile = tile}});
            const std::string whole = clratio::test::bytes_of(scratch / "a.exr");
            const std::size_t head = clratio::test::header_end(whole);
            for (std::size_t at = 0; at < whole.size(); at += at < head ? 1 : 13) {
                std::string damaged = whole;
                damaged[at] = static_cast<char>(~damaged[at]);
                clratio::test::put_bytes(scratch / "b.exr", damaged);
                try {
                    const Image image = read_image(scratch / "b.exr");
                    EXPECT_EQ(image.size(), static_cast<std::size_t>(image.width()) *
                                                static_cast<std::size_t>(image.height()) * image.channels.size());
                } catch (const IoError&) {
                }
            }
        }
}

TEST(Image, refuses_a_header_that_asks_for_more_than_the_file_holds) {
    const clratio::test::Scratch scratch;
    clratio::test::write_exr(scratch / "a.exr", {ExrPart{}});
    std::string damaged = clratio::test::bytes_of(scratch / "a.exr");
    const int wide = 1 << 24;
    std::memcpy(&damaged[damaged.find("dataWindow") + sizeof "dataWindow" + sizeof "box2i" + 4 + 8], &wide, 4);
    clratio::test::put_bytes(scratch / "b.exr", damaged);
    expect_in("asks for more pixels than the file can hold", refusal(scratch / "b.exr").what());
}

TEST(Image, a_written_file_has_the_same_bits) {
    const clratio::test::Scratch scratch;
    Image image = small_image();
    image.values[0] = std::numeric_limits<float>::infinity();
    image.values[1] = std::bit_cast<float>(0x7fc12345u);
    image.values[2] = -0.0f;
    image.values[3] = std::numeric_limits<float>::denorm_min();
    for (int i = 0; i < 9 * 7; ++i) image.alpha.push_back(static_cast<float>(i) / 64);
    write_image(scratch / "a.exr", image);
    const Image back = read_image(scratch / "a.exr");
    EXPECT_TRUE(same_bits(back.values, image.values));
    EXPECT_TRUE(same_bits(back.alpha, image.alpha));
    EXPECT_EQ(back.channels, image.channels);
    EXPECT_EQ(back.data_window, image.data_window);
    EXPECT_EQ(back.display_window, image.display_window);
    EXPECT_EQ(scratch.files(), 1u);
}

TEST(Image, metadata_is_carried_and_settings_are_added) {
    const clratio::test::Scratch scratch;
    Image image = read_image(CLRATIO_TEST_DATA "/cycles/multilayer/m_000.exr");
    write_image(scratch / "a.exr", image, {{{"clratio/estimator", "ratio"}}});
    Imf::MultiPartInputFile was(CLRATIO_TEST_DATA "/cycles/multilayer/m_000.exr"), is((scratch / "a.exr").c_str());
    const auto& header = is.header(0);
    EXPECT_EQ(header.typedAttribute<Imf::StringAttribute>("clratio/estimator").value(), "ratio");
    EXPECT_EQ(header.compression(), Imf::ZIP_COMPRESSION);
    EXPECT_EQ(header.channels().findChannel("R")->type, Imf::FLOAT);
    EXPECT_EQ(header.findTypedAttribute<Imf::StringAttribute>("BlenderMultiChannel"), nullptr);
    const std::set<std::string> own{"channels", "compression", "lineOrder", "chunkCount", "type", "BlenderMultiChannel"};
    int carried = 0;
    for (auto a = was.header(0).begin(); a != was.header(0).end(); ++a) {
        if (own.count(a.name())) continue;
        ASSERT_NE(header.find(a.name()), header.end()) << a.name();
        EXPECT_STREQ(header.find(a.name()).attribute().typeName(), a.attribute().typeName());
        ++carried;
    }
    EXPECT_GT(carried, 8);
    EXPECT_EQ(read_image(scratch / "a.exr").layer, "");
}

TEST(Image, flags_are_uint_channels) {
    const clratio::test::Scratch scratch;
    const Image like = small_image();
    std::vector<std::uint32_t> flags(like.size());
    for (std::size_t i = 0; i < flags.size(); ++i) flags[i] = static_cast<std::uint32_t>(i % 64);
    write_flags(scratch / "f.exr", like, flags);
    const Image back = read_image(scratch / "f.exr");
    EXPECT_TRUE(std::equal(flags.begin(), flags.end(), back.values.begin(), back.values.end()));
    Imf::MultiPartInputFile file((scratch / "f.exr").c_str());
    EXPECT_EQ(file.header(0).channels().findChannel("G")->type, Imf::UINT);
}

TEST(Image, refuses_to_write_what_does_not_fit_together) {
    const clratio::test::Scratch scratch;
    const auto refused = [&](const char* name, auto change) {
        Image image = small_image();
        change(image);
        try {
            write_image(scratch / "a.exr", image);
            ADD_FAILURE() << name;
        } catch (const InvalidArgument& e) {
            EXPECT_EQ(e.name, name);
        }
    };
    refused("values", [](Image& i) { i.values.pop_back(); });
    refused("alpha", [](Image& i) { i.alpha.resize(1); });
    refused("channels", [](Image& i) { i.channels.clear(); });
    refused("channels", [](Image& i) { i.channels = {"R", "R", "B"}; });
    refused("data_window", [](Image& i) { i.data_window = {}; });
    const std::vector<std::uint32_t> flags(3);
    EXPECT_THROW(write_flags(scratch / "a.exr", small_image(), flags), InvalidArgument);
    EXPECT_EQ(scratch.files(), 0u);
}

TEST(Image, refuses_targets_that_are_no_files) {
    const clratio::test::Scratch scratch;
    for (const std::string target : {"/dev/null", "/nowhere/a.exr", "/tmp"}) {
        try {
            write_image(target, small_image());
            ADD_FAILURE() << target;
        } catch (const IoError& e) {
            EXPECT_EQ(e.path, target);
            expect_in(target + ": cannot be written: ", e.what());
        }
    }
}

TEST(Image, a_link_is_followed) {
    const clratio::test::Scratch scratch;
    write_image(scratch / "a.exr", small_image());
    std::filesystem::create_symlink("a.exr", scratch / "link.exr");
    Image other = small_image();
    other.values[0] = 7;
    write_image(scratch / "link.exr", other);
    EXPECT_TRUE(std::filesystem::is_symlink(scratch / "link.exr"));
    EXPECT_EQ(read_image(scratch / "a.exr").values[0], 7);

    std::filesystem::create_symlink("new.exr", scratch / "leads_nowhere.exr");
    write_image(scratch / "leads_nowhere.exr", other);
    EXPECT_TRUE(std::filesystem::is_symlink(scratch / "leads_nowhere.exr"));
    EXPECT_EQ(read_image(scratch / "new.exr").values[0], 7);
}

TEST(Image, a_replaced_file_is_as_private_as_it_was) {
    const clratio::test::Scratch scratch;
    const std::string file = scratch / "a.exr";
    write_image(file, small_image());
    constexpr auto mine = std::filesystem::perms::owner_read | std::filesystem::perms::owner_write;
    std::filesystem::permissions(file, mine);
    write_image(file, small_image());
    EXPECT_EQ(std::filesystem::status(file).permissions(), mine);
}

namespace {

Ended write_limited(const std::string& path, const Image& image, std::size_t limit) {
    return limited(limit, path, [&] { write_image(path, image); });
}

}  // namespace

TEST(Image, a_full_disk_is_an_error_and_leaves_the_old_file) {
    const clratio::test::Scratch scratch;
    const std::string path = scratch / "a.exr";
    Image image = small_image();
    write_image(path, image);
    const std::string old = clratio::test::bytes_of(path);
    image.values[5] = 3;
    write_image(scratch / "b.exr", image);
    const std::size_t size = clratio::test::bytes_of(scratch / "b.exr").size();

    for (std::size_t limit = 0; limit < size; limit = limit + 40 < size ? limit + 40 : limit + 1) {
        EXPECT_EQ(write_limited(path, image, limit), Ended::refused) << limit << " of " << size << " bytes";
        EXPECT_EQ(clratio::test::bytes_of(path), old);
        EXPECT_EQ(scratch.files(), 2u) << "the temporary file is gone";
    }
    EXPECT_EQ(write_limited(path, image, size), Ended::wrote);
    EXPECT_EQ(clratio::test::bytes_of(path), clratio::test::bytes_of(scratch / "b.exr"));
    EXPECT_EQ(scratch.files(), 2u);
}

// As OpenEXR's destructor does when it writes the offset table.
TEST(Image, a_failed_write_that_was_swallowed_is_thrown_at_close) {
    const clratio::test::Scratch scratch;
    const auto write = [&](std::size_t bytes) {
        ExrStream out(scratch / "a.exr");
        try {
            out.write(std::string(bytes, 'x').c_str(), static_cast<int>(bytes));
        } catch (const std::exception&) {
        }
        try {
            out.file().close_synced();
        } catch (const std::exception& e) {
            throw IoError("a.exr", "", e.what());
        }
    };
    EXPECT_EQ(limited(100, "a.exr", [&] { write(100); }), Ended::wrote);
    EXPECT_EQ(limited(100, "a.exr", [&] { write(101); }), Ended::refused);
    EXPECT_EQ(scratch.files(), 0u);
}

TEST(Image, channels_that_the_file_would_change_are_refused) {
    const clratio::test::Scratch scratch;
    const auto channels = [&](const Image& image) -> std::string {
        try {
            write_image(scratch / "a.exr", image);
        } catch (const InvalidArgument& e) {
            return e.name;
        }
        return "";
    };
    Image image = small_image();
    image.channels.front() = std::string(255, 'x');
    EXPECT_EQ(channels(image), "");
    EXPECT_EQ(read_image(scratch / "a.exr").channels.size(), image.channels.size());
    image.channels.front() += 'x';
    EXPECT_EQ(channels(image), "channels");
    image.channels.front() = "A";
    image.alpha.assign(static_cast<std::size_t>(image.width()) * static_cast<std::size_t>(image.height()), 1.0f);
    EXPECT_EQ(channels(image), "channels");
    EXPECT_THROW(set_image_threads(1u << 31), InvalidArgument);
}

TEST(Image, other_shapes_are_refused_with_both_names) {
    Image a = small_image();
    a.path = "a.exr";
    const auto refused = [&](auto change) {
        Image b = a;
        b.path = "b.exr";
        EXPECT_NO_THROW(require_same_shape(a, b));
        change(b);
        try {
            require_same_shape(a, b);
            ADD_FAILURE();
        } catch (const InvalidArgument& e) {
            expect_in("a.exr", e.what());
            expect_in("b.exr", e.what());
        }
    };
    refused([](Image& i) { i.data_window.x1 += 1; });
    refused([](Image& i) { i.display_window.y0 -= 1; });
    refused([](Image& i) { i.channels = {"X", "Y", "Z"}; });
}

TEST(Image, combines_with_an_image_of_tau_and_keeps_its_shape) {
    const clratio::test::Scratch scratch;
    const std::string folder = CLRATIO_TEST_DATA "/cycles/multilayer/";
    Engine engine;
    auto tau = read_image(folder + "t_ref.exr");
    Moments sum{engine, tau.size()};
    for (const char* k : {"000", "001"})
        sum.add(read_image(folder + "m_" + k + ".exr"), read_image(folder + "t_" + k + ".exr"));
    auto out = combine(sum, tau, {.zero = Zero::mc_mean});
    write_image(scratch / "out.exr", out.estimate);
    EXPECT_EQ(out.flags.total(), out.flags.any);
    const Image back = read_image(scratch / "out.exr");
    EXPECT_NO_THROW(require_same_shape(back, tau));
    EXPECT_EQ(back.values, out.estimate.values);
    EXPECT_EQ(back.alpha, tau.alpha);
    EXPECT_EQ(back.values, combine(sum, Tau(tau)).estimate);
}
