// Everything the library throws. It never prints, aborts or exits.
#pragma once

#include <stdexcept>
#include <string>

namespace clratio {

/// The base of all exceptions of the library; what() is the whole message. std::bad_alloc may come besides.
class Error : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// An argument that cannot be used: which one, what was expected, what came.
class InvalidArgument : public Error {
public:
    InvalidArgument(const std::string& argument, const std::string& wanted, const std::string& came)
        : Error(argument + ": expected " + wanted + ", got " + came), name(argument), expected(wanted), got(came) {}
    std::string name, expected, got;
};

/// An OpenCL call that failed, with its code by name ("CL_OUT_OF_RESOURCES").
class DeviceError : public Error {
public:
    DeviceError(std::string call, int code);
    DeviceError(std::string call, int code, const std::string& hint);
    std::string call;
    int code;
};

/// A kernel program that did not build: the whole log, with the real file and line of each message.
class BuildError : public Error {
public:
    BuildError(const std::string& kernel_word, const std::string& build_log)
        : Error("kernels/" + kernel_word + ".cl does not build on this device:\n" + build_log), word(kernel_word),
          log(build_log) {}
    std::string word, log;
};

/// A file that cannot be read or written: its path, the layer where one was asked for, the reason.
class IoError : public Error {
public:
    IoError(const std::string& file, const std::string& file_layer, const std::string& why)
        : Error(file + (file_layer.empty() ? "" : ":" + file_layer) + ": " + why), path(file), layer(file_layer),
          reason(why) {}
    std::string path, layer, reason;
};

/// Thrown out of a blocking call whose progress callback asked to stop.
class Cancelled : public Error {
public:
    Cancelled() : Error("cancelled") {}
};

}  // namespace clratio
