#include "exr_layers.hpp"

#include <ImfChannelList.h>
#include <ImfHeader.h>
#include <ImfPartType.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>

namespace clratio {
namespace {

bool has(const std::vector<std::string>& all, const char* one) {
    return std::find(all.begin(), all.end(), one) != all.end();
}

// From the channels of a layer, alpha left out, to those that are combined and whether they are a colour.
void choose_channels(Layer& layer) {
    auto& c = layer.channels;
    if (has(c, "R") && has(c, "G") && has(c, "B")) {
        c = {"R", "G", "B"};
        layer.colour = true;
    } else if (has(c, "Y") && !has(c, "X")) {
        layer.colour = true;
        if (!has(c, "RY") && !has(c, "BY")) c = {"Y"};
    }
}

std::vector<Layer> layers_of_part(const Imf::Header& header, int part, bool many_parts) {
    std::map<std::string, Layer> by_prefix;
    const auto& list = header.channels();
    const bool deep = header.hasType() && Imf::isDeepData(header.type());
    for (auto c = list.begin(); c != list.end(); ++c) {
        const std::string full = c.name();
        const auto dot = full.rfind('.');
        const std::string prefix = dot == std::string::npos ? "" : full.substr(0, dot);
        const std::string channel = dot == std::string::npos ? full : full.substr(dot + 1);
        Layer& layer = by_prefix[prefix];
        layer.part = part;
        layer.prefix = prefix;
        layer.deep = deep;
        if (channel == "A")
            layer.alpha = true;
        else
            layer.channels.push_back(channel);
        if ((c.channel().xSampling != 1 || c.channel().ySampling != 1) && layer.subsampled.empty()) layer.subsampled = full;
    }
    std::vector<Layer> layers;
    for (auto& [prefix, layer] : by_prefix) {
        if (layer.channels.empty()) {
            layer.channels.emplace_back("A");
            layer.alpha = false;
        }
        choose_channels(layer);
        if (!prefix.empty()) layer.names.push_back(prefix);
        if (many_parts && header.hasName()) layer.names.push_back(header.name() + (prefix.empty() ? "" : "." + prefix));
        layers.push_back(std::move(layer));
    }
    return layers;
}

std::string list_of(const std::vector<Layer>& layers) {
    std::string text;
    for (const Layer& layer : layers) {
        text += text.empty() ? "" : ", ";
        text += layer.names.empty() ? "(unnamed)" : layer.names.back();
        text += layer.colour ? "" : " (not a colour)";
    }
    return text;
}

template <class Predicate> std::vector<Layer> those(const std::vector<Layer>& layers, Predicate predicate) {
    std::vector<Layer> some;
    std::copy_if(layers.begin(), layers.end(), std::back_inserter(some), predicate);
    return some;
}

}  // namespace

std::vector<Layer> layers_of(const Imf::MultiPartInputFile& file) {
    std::vector<Layer> all;
    for (int part = 0; part < file.parts(); ++part) {
        auto some = layers_of_part(file.header(part), part, file.parts() > 1);
        std::move(some.begin(), some.end(), std::back_inserter(all));
    }
    return all;
}

Layer choose_layer(const std::vector<Layer>& layers, const std::string& wanted) {
    if (layers.empty()) throw std::runtime_error("has no channels");
    if (!wanted.empty()) {
        const auto called = those(layers, [&](const Layer& l) { return has(l.names, wanted.c_str()); });
        if (called.size() == 1) return called.front();
        const std::string several = "several layers of that name: name the part too: ";
        throw std::runtime_error((called.empty() ? "no such layer; the file has " : several) +
                                 list_of(called.empty() ? layers : called));
    }
    const auto colours = those(layers, [](const Layer& l) { return l.colour; });
    if (colours.size() == 1) return colours.front();
    const auto unnamed = those(colours, [](const Layer& l) { return l.prefix.empty(); });
    if (unnamed.size() == 1) return unnamed.front();
    if (colours.empty() && layers.size() == 1) return layers.front();
    throw std::runtime_error("several layers and none named (FILE:LAYER, or --layer): " +
                             list_of(colours.empty() ? layers : colours));
}

}  // namespace clratio
