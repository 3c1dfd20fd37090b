// SPDX-License-Identifier: GPL-3.0-or-later
// A job type of Flamenco 3: light-field frames, split by rows of lenses, merged and finished. Put this file into the
// folder "scripts" beside flamenco-manager and restart it.
// Every task may be repeated: files appear whole or not at all.

const JOB_TYPE = {
    label: "LFSR light field",
    description: "Render frames for a glasses-free 3D display: in parts, merged, and every view made",
    settings: [
        { key: "frames", type: "string", required: true, eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
          evalInfo: { showLinkButton: true, description: "Scene frame range" },
          description: "Frame range, as 47, 1-30 or 3, 5-10" },
        { key: "parts", type: "int32", default: 1, propargs: { min: 1, max: 1000 },
          description: "Parts into which each frame is split, by rows of lenses" },
        { key: "output", type: "string", subtype: "dir_path", required: true,
          description: "Folder that every worker sees; frame 1 goes to its folder 0001" },
        { key: "display", type: "string", default: "bupt-32in-8k", description: "Display profile" },
        { key: "scale", type: "string", default: "auto",
          description: "auto for one scale of all frames by their depth, or 1, 2, 3, 4, 5, 8" },
        { key: "rays", type: "float", default: 1, propargs: { min: 0.01 },
          description: "Rays per finished pixel; 1 is 16 samples per rendered pixel at scale 4, 4 at scale 2" },
        { key: "seed", type: "int32", default: 0, propargs: { min: 0 } },
        { key: "light", type: "string", default: "auto",
          description: "auto, own, even, one of Blender's world images, or a .hdr or .exr file that every worker sees" },
        { key: "device", type: "string", default: "auto", description: "auto, CPU, OPTIX, CUDA, HIP, ONEAPI or METAL" },
        { key: "method", type: "string", default: "denoise+pool", description: "Method that makes the other views" },
        { key: "linear", type: "string", default: "--no-linear-exr", choices: ["--no-linear-exr", "--linear-exr"],
          description: "Whether the image before the view transform is written too" },
        { key: "temporalaveraging", type: "int32", default: 0, propargs: { min: 0, max: 8 },
          description: "Temporal averaging: neighbouring frames to each side, 0 for none" },
        { key: "lfsr", type: "string", default: "lfsr", visible: "submission",
          description: "The command, where it is not on the workers' path" },
        { key: "blendfile", type: "string", required: true, visible: "web",
          description: "Scene to render; Flamenco's add-on fills it in" },
    ],
};

function compileJob(job) {
    const frames = Array.from(frameChunker(job.settings.frames, 1)).sort((a, b) => a - b);
    // The first and the last frames are averaged with more frames on their other side.
    const reach = 2 * job.settings.temporalaveraging, merges = [];
    for (let index = 0; index < frames.length + reach; index++) {
        if (index < frames.length) {
            merges.push(addMerge(job, frames[index]));
        }
        if (index >= reach) {
            addFinish(job, frames[index - reach], merges.slice(Math.max(0, index - 2 * reach), index + 1));
        }
    }
}

function addMerge(job, frame) {
    const merge = lfsrTask(job.settings, `merge-${frame}`,
        ["merge", partsFolder(job.settings, frame), "--output", job.settings.output, "--numbered"]);
    for (const render of renderTasks(job.settings, frame)) {
        merge.addDependency(render);
        job.addTask(render);
    }
    job.addTask(merge);
    return merge;
}

// merges: of the frame and of those that it may be averaged with.
function addFinish(job, frame, merges) {
    const finish = lfsrTask(job.settings, `finish-${frame}`,
        ["upscale", job.settings.output, "--frame", frame, "--method", job.settings.method, job.settings.linear,
            "--temporal-averaging", String(job.settings.temporalaveraging)]);
    for (const merge of merges) {
        finish.addDependency(merge);
    }
    job.addTask(finish);
}

function renderTasks(settings, frame) {
    const tasks = [];
    for (let part = 1; part <= settings.parts; part++) {
        tasks.push(lfsrTask(settings, `render-${frame}-${part}of${settings.parts}`, [
            "render", settings.blendfile, "--output", path.join(partsFolder(settings, frame), String(part)),
            "--frame", frame, "--rows", `${part}/${settings.parts}`, "--display", settings.display,
            "--scale", settings.scale, "--scale-frames", settings.frames, "--rays", String(settings.rays),
            "--seed", String(settings.seed), "--light", settings.light,
            "--temporal-averaging", String(settings.temporalaveraging), "--device", settings.device, "--method", settings.method]));
    }
    return tasks;
}

function partsFolder(settings, frame) {
    return path.join(settings.output, "parts", `of-${settings.parts}`, frame);
}

function lfsrTask(settings, name, args) {
    const task = author.Task(name, "blender");
    task.addCommand(author.Command("exec", { exe: settings.lfsr, args: args }));
    return task;
}
