// SPDX-License-Identifier: GPL-3.0-or-later
//
// Flamenco job type: a batch of photos in shards, one task each, then one task that joins them.
//
// Put this file into the folder "scripts" of the Flamenco Manager. Blender with the GS-SMC extension has to be on all workers, and
// scan, photos and results on the storage that they share. docs/farm.md says how to submit a job.

const JOB_TYPE = {
    label: "GS-SMC Batch",
    description: "Find the exact cameras of photos inside a 3D Gaussian Splatting scan",
    settings: [
        { key: "scan", type: "string", subtype: "file_path", required: true, description: "The splat file" },
        { key: "queries", type: "string", required: true, description: "Camera JSON or data set's folder with the photos" },
        { key: "results", type: "string", subtype: "file_path", required: true, description: "Results JSON to be written" },
        { key: "shards", type: "int32", default: 20, description: "Into how many tasks the photos are split" },
        { key: "processes", type: "int32", default: 0, description: "Processes per task; 0: as many as the machine has cores" },
        { key: "find", type: "bool", default: true, description: "Search for photos that have no start, or whose start failed" },
        { key: "options", type: "string", default: "", description: "Further options of the command batch, with spaces between them" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    if (settings.shards < 1) {
        throw new Error("The setting 'shards' is below 1; give into how many tasks the photos are split.");
    }
    const shards = [];
    for (let number = 1; number <= settings.shards; number++) {
        const task = author.Task(`shard-${number}`, "misc");
        task.addCommand(engine(["batch", settings.scan, settings.queries, "--out", settings.results].concat(
            ["--shard", `${number}/${settings.shards}`, "--exit-zero"], optionsOf(settings))));
        shards.push(task);
    }
    if (settings.find) {
        // The shards search with one map of the scan, which lies beside it; without this task each would make it for itself.
        const map = author.Task("map", "misc");
        map.addCommand(engine(["map", settings.scan]));
        shards.forEach((task) => task.addDependency(map));
        job.addTask(map);
    }
    const merge = author.Task("merge", "misc");
    merge.addCommand(engine(["merge", "--out", settings.results, "--exit-zero"]));
    for (const task of shards) {
        job.addTask(task);
        merge.addDependency(task);
    }
    job.addTask(merge);
}

function optionsOf(settings) {
    const given = settings.options ? settings.options.split(" ").filter((word) => word.length > 0) : [];
    return given.concat(
        settings.processes > 0 ? ["--workers", String(settings.processes)] : [],
        settings.find ? [] : ["--no-locate"]);
}

function engine(args) {
    // Flamenco puts the path of each platform's Blender in the place of {blender}.
    return author.Command("exec", { exe: "{blender}", args: ["--command", "gssmc"].concat(args) });
}
